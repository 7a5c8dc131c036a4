//! An interface of the C functions for Fortran 2003.

use super::about::About;
use super::program::Program;

pub(super) fn source(program: &Program, about: &About<'_>) -> String {
    let (name, dim) = (about.name, program.dim);
    let point = format!("real(c_double), intent(inout) :: z({dim})");
    let fixed = format!("real(c_double), intent(in) :: z({dim})");
    let subroutine = |of: &str, arguments: &str, declared: &[&str]| {
        let lines: Vec<String> = declared.iter().map(|line| format!("      {line}\n")).collect();
        let import = "import :: c_double, c_long_long";
        format!(
            "    subroutine {name}_{of}({arguments}) &\n        bind(C, name=\"{name}_{of}\")\n      {import}\n{}    \
             end subroutine\n",
            lines.concat()
        )
    };
    let function = |of: &str, kind: &str| {
        format!(
            "    function {name}_{of}(z) &\n        bind(C, name=\"{name}_{of}\") result(value)\n      \
             import :: c_double, c_int\n      {fixed}\n      {kind} :: value\n    end function\n"
        )
    };
    let direction = format!("real(c_double), intent(inout) :: v({dim})");
    // Lines have 132 letters at most.
    let comment = |line: &String| {
        let letters: Vec<char> = line.chars().collect();
        let parts =
            letters.chunks(120).map(|part| format!("! {}\n", part.iter().collect::<String>()));
        parts.collect::<String>()
    };
    let mut out: String = about.lines.iter().map(comment).collect();
    out += &format!(
        "module {name}_module\n  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_long_long\n  implicit none\n  \
         integer, parameter :: {name}_dim = {dim}\n  interface\n"
    );
    out += &subroutine("map", "z", &[&point]);
    out += &subroutine("inverse", "z", &[&point]);
    out += &subroutine("iterate", "z, steps", &[&point, "integer(c_long_long), value :: steps"]);
    out += &subroutine("tangent", "z, v", &[&point, &direction]);
    out += &function("is_inside", "integer(c_int)");
    if program.invariant.is_some() {
        out += &function("invariant", "real(c_double)");
    }
    out + "  end interface\nend module\n"
}
