//! The program `gyroceptron`: arguments in, results out. All mathematics is in
//! the library.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
