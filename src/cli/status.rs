//! How a command ended.

/// What a command came to, which decides the exit status of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The command did what was asked for.
    Done,
    /// A check did not hold.
    CheckFailed,
    /// The command was stopped by Ctrl-C.
    Interrupted,
}
