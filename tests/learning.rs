//! From pairs to trained models, and the files of both.

mod blocks;
mod controls;
mod family;
mod files;
mod fit;
mod optimisers;
mod polynomial_fit;
mod schedule;
mod source_code;
mod training;
