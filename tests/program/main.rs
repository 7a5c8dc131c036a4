//! The program, as its users call it.

mod abilities;
mod about;
mod architectures;
mod coils;
mod controls;
mod fit;
mod grid;
mod guide;
mod helpers;
mod jobs;
#[path = "../judgement.rs"]
mod judgement;
#[path = "../own_scenes.rs"]
mod own_scenes;
mod pages;
mod proofs;
mod refusals;
mod reports;
mod resuming;
mod scenes;
mod section;
mod source_code;
mod training;
