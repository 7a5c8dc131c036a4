//! From pairs to trained models, and the files of both.

mod family;
mod files;
mod schedule;
mod training;
