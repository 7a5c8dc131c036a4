//! Models in C99.

use super::about::About;
use super::program::{Calls, Function, Line, Program};
use crate::io::StoredModel;
use crate::phase::{AreaDensity, CHART_STEPS};
use crate::scalar::{Operation, Traced, TracedKernel};
use std::collections::BTreeSet;
use std::fmt::Write;

const HELPERS: &str = include_str!("helpers.c");
const CHART: &str = include_str!("chart.c");

/// A number to the last bit, as C99 has it.
fn number(value: f64) -> String {
    if value.is_nan() {
        return "NAN".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { "INFINITY".into() } else { "-INFINITY".into() };
    }
    let short = format!("{value:?}");
    if short.len() <= 6 && !short.contains('e') {
        return short;
    }
    let bits = value.abs().to_bits();
    let (exponent, fraction) = ((bits >> 52) as i64, bits & ((1 << 52) - 1));
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let (leading, exponent) = if exponent == 0 { (0, -1022) } else { (1, exponent - 1023) };
    let digits = format!("{fraction:013x}");
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x{leading}{point}{digits}p{exponent}")
}

/// Names of kernels by what is asked of them: its first function, its second, both.
fn kernel_name(kernel: TracedKernel, part: Option<usize>) -> &'static str {
    match (kernel, part) {
        (TracedKernel::TanhSech2, Some(0)) => "exact_tanh",
        (TracedKernel::TanhSech2, Some(_)) => "exact_sech2",
        (TracedKernel::TanhSech2, None) => "exact_tanh_sech2",
        (TracedKernel::Lorentzian, Some(0)) => "exact_odd_lorentzian",
        (TracedKernel::Lorentzian, Some(_)) => "exact_lorentzian",
        (TracedKernel::Lorentzian, None) => "exact_lorentzians",
        (TracedKernel::SinCos, Some(0)) => "exact_sin",
        (TracedKernel::SinCos, Some(_)) => "exact_cos",
        (TracedKernel::SinCos, None) => "exact_sin_cos",
    }
}

/// The kernels that functions call.
type Kernels = BTreeSet<(TracedKernel, Option<usize>)>;

/// The lines of a function, and how the numbers are named afterwards.
struct Body {
    text: String,
    names: Vec<String>,
}

impl Body {
    fn name(&self, of: Traced) -> &str {
        &self.names[of.place()]
    }
}

/// The body of a function in C, with the names of its input numbers in `inputs`.
fn body(function: &Function, inputs: &[String], kernels: &mut Kernels) -> Body {
    let mut out = Body { text: String::new(), names: Vec::new() };
    for Line { result, operation, number: place } in &function.lines {
        let at = result.place();
        let of = |number: &Traced| out.names[number.place()].clone();
        // Both functions of a kernel are made by one call, at the first of them.
        let pair = |at: usize| match function
            .lines
            .get(at..at + 2)
            .map(|two| (two[0].operation, two[1].operation))
        {
            Some((Operation::Kernel(kernel, 0, x), Operation::Kernel(other, 1, y))) => {
                kernel == other && x == y
            }
            _ => false,
        };
        let value = match operation {
            Operation::Input(k) => {
                out.names.push(inputs[*k].clone());
                continue;
            }
            Operation::Constant(value) | Operation::Parameter(value) => {
                out.names.push(match place {
                    Some(place) => format!("c[{place}]"),
                    None if value.is_sign_negative() => format!("({})", number(*value)),
                    None => number(*value),
                });
                continue;
            }
            Operation::Kernel(kernel, _, x) if pair(at) => {
                kernels.insert((*kernel, None));
                let name = kernel_name(*kernel, None);
                let _ = writeln!(
                    out.text,
                    "    double t{at}, t{};\n    {name}({}, &t{at}, &t{});",
                    at + 1,
                    of(x),
                    at + 1
                );
                out.names.push(format!("t{at}"));
                continue;
            }
            Operation::Kernel(_, 1, _) if at > 0 && pair(at - 1) => {
                out.names.push(format!("t{at}"));
                continue;
            }
            Operation::Kernel(kernel, part, x) => {
                kernels.insert((*kernel, Some(*part)));
                format!("{}({})", kernel_name(*kernel, Some(*part)), of(x))
            }
            Operation::Negative(x) => format!("-{}", of(x)),
            Operation::Sum(x, y) => format!("{} + {}", of(x), of(y)),
            Operation::Difference(x, y) => format!("{} - {}", of(x), of(y)),
            Operation::Product(x, y) => format!("{} * {}", of(x), of(y)),
            Operation::Quotient(x, y) => format!("{} / {}", of(x), of(y)),
            Operation::MulAdd([x, y, z]) => format!("fma({}, {}, {})", of(x), of(y), of(z)),
            Operation::Magnitude(x) => format!("fabs({})", of(x)),
            Operation::Sqrt(x) => format!("sqrt({})", of(x)),
            Operation::AtMost(x, most) => {
                let (x, most) = (of(x), number(*most));
                format!("{x} > {most} ? {most} : {x}")
            }
            Operation::PowerOfLowBits(x) => format!("from_bits(to_bits({}) << 52)", of(x)),
            Operation::MinusBits(x, y) => {
                format!("from_bits(to_bits({}) - to_bits({}))", of(x), of(y))
            }
            Operation::BitAsSign(x, bit) => {
                format!("from_bits(to_bits({}) << {})", of(x), 63 - bit)
            }
            Operation::SelectAbove([x, above, other], limit) => {
                format!("{} > {} ? {} : {}", of(x), number(*limit), of(above), of(other))
            }
            Operation::SelectNegative([x, negative, other]) => {
                format!("signbit({}) ? {} : {}", of(x), of(negative), of(other))
            }
            Operation::WithSignOf(x, sign) => format!("copysign({}, {})", of(x), of(sign)),
            Operation::NegatedWhere(x, sign) => format!("negated_where({}, {})", of(x), of(sign)),
            Operation::Other(_) => unreachable!("`Function::from_trace` refuses it"),
        };
        let _ = writeln!(out.text, "    const double t{at} = {value};");
        out.names.push(format!("t{at}"));
    }
    out
}

/// A kernel, and that of its functions which is asked for.
fn kernel(kernel: TracedKernel, part: Option<usize>) -> String {
    let mut trace = kernel.trace();
    if let Some(part) = part {
        trace.outputs = vec![trace.outputs[part]];
    }
    let function = Function::from_trace(String::new(), &trace, None).expect("operations of C");
    let body = body(&function, &["x".to_owned()], &mut Kernels::new());
    let (name, text) = (kernel_name(kernel, part), &body.text);
    match function.outputs[..] {
        [only] => format!(
            "static inline double {name}(double x) {{\n{text}    return {};\n}}\n\n",
            body.name(only)
        ),
        _ => format!(
            "static inline void {name}(double x, double *first, double *second) {{\n{text}    *first = {};\n    \
             *second = {};\n}}\n\n",
            body.name(function.outputs[0]),
            body.name(function.outputs[1])
        ),
    }
}

/// A step, of the numbers c and the point z.
fn step(function: &Function, kernels: &mut Kernels) -> String {
    let count = function.outputs.len();
    let inputs: Vec<String> = (0..count).map(|k| format!("z{k}")).collect();
    let body = body(function, &inputs, kernels);
    let mut out = format!(
        "static void {}(const double *c, double *z, double *reach) {{\n    UNUSED(c);\n    UNUSED(reach);\n",
        function.name
    );
    for line in &function.lines {
        let Operation::Input(k) = line.operation else { continue };
        let is_operand = |other: &Line| other.operation.operands().contains(&line.result);
        let mut slots = function.outputs.iter().enumerate();
        let goes_elsewhere = slots.any(|(slot, of)| *of == line.result && slot != k);
        let is_argument = function.arguments.contains(&line.result);
        if goes_elsewhere || is_argument || function.lines.iter().any(is_operand) {
            let _ = writeln!(out, "    const double z{k} = z[{k}];");
        }
    }
    out += &body.text;
    for (k, output) in function.outputs.iter().enumerate() {
        let value = body.name(*output);
        if value != inputs[k] {
            let _ = writeln!(out, "    z[{k}] = {value};");
        }
    }
    if !function.arguments.is_empty() {
        out += "    if (reach) {\n";
        for argument in &function.arguments {
            let _ =
                writeln!(out, "        *reach = larger(*reach, fabs({}));", body.name(*argument));
        }
        out += "    }\n";
    }
    out + "}\n\n"
}

/// A function that makes calls one after another.
fn calls(name: &str, calls: &Calls, program: &Program) -> String {
    let mut out = format!(
        "static void {name}(double *z, double *reach) {{\n    UNUSED(z);\n    UNUSED(reach);\n"
    );
    for call in calls {
        let function = &program.functions[call.function].name;
        let _ = writeln!(out, "    {function}(table + {}, z, reach);", call.numbers);
    }
    out + "}\n\n"
}

fn array(name: &str, values: &[f64]) -> String {
    let mut out = format!("static const double {name}[] = {{\n");
    for row in values.chunks(4) {
        let row: Vec<String> = row.iter().map(|value| number(*value)).collect();
        let _ = writeln!(out, "    {},", row.join(", "));
    }
    // C has no array of no numbers.
    let none = if values.is_empty() { "    0.0,\n" } else { "" };
    format!("{out}{none}}};\n\n")
}

fn comment(lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| format!(" * {line}\n")).collect();
    format!("/*\n{} */\n", lines.concat())
}

/// The functions of the header, each with a comment.
fn interface(program: &Program, name: &str) -> Vec<(String, String)> {
    let dim = program.dim;
    let mut out = vec![
        (format!("const char *{name}_digest(void)"), "The digest of the model.".to_owned()),
        (format!("void {name}_map(double z[{dim}])"), "A step of the map.".to_owned()),
        (format!("void {name}_inverse(double z[{dim}])"), "A step back.".to_owned()),
        (
            format!("void {name}_iterate(double z[{dim}], long long steps)"),
            "So many steps, or steps back where the number is negative. The point is converted to the coordinates of\n   \
             the network once and back once, so that n steps in one call round less than n calls of map."
                .to_owned(),
        ),
        (
            format!("void {name}_tangent(double z[{dim}], double v[{dim}])"),
            "A step of z, and v becomes the derivative of the map along v.".to_owned(),
        ),
        (
            format!("int {name}_is_inside(const double z[{dim}])"),
            "1 where z and the step from it are inside of the boxes that the model is made for, else 0. These are the\n   \
             box of the training points, widened by a hundredth, and the boxes of its polynomials and sections."
                .to_owned(),
        ),
    ];
    if program.invariant.is_some() {
        out.push((
            format!("double {name}_invariant(const double z[{dim}])"),
            "The invariant of the model.".to_owned(),
        ));
    }
    out
}

pub(super) fn header(program: &Program, about: &About<'_>) -> String {
    let (name, dim) = (about.name, program.dim);
    let (guard, mut out) = (name.to_uppercase(), comment(&about.lines));
    let _ = write!(
        out,
        "#ifndef {guard}_H\n#define {guard}_H\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n#define {guard}_DIM {dim}\n\n"
    );
    for (function, what) in interface(program, name) {
        let _ = write!(out, "/* {what} */\n{function};\n\n");
    }
    out + "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
}

/// The charts of a section, and what goes to them and back.
fn charts(planes: &[Option<AreaDensity>]) -> String {
    let charts = || planes.iter().enumerate().filter_map(|(j, plane)| Some((j, plane.as_ref()?)));
    let size = charts().map(|(_, plane)| plane.degrees()[0] + 2).max().unwrap_or(1);
    let mut out =
        format!("#define CHART_SIZE {size}\n#define CHART_STEPS {CHART_STEPS}\n\n{CHART}\n");
    for (j, plane) in charts() {
        let ([a, b], [c, d]) = (plane.low(), plane.high());
        let [x, y] = plane.degrees();
        out += &array(&format!("coefficients_{j}"), plane.coefficients());
        let _ = write!(
            out,
            "static const chart chart_{j} = {{{{{}, {}}}, {{{}, {}}}, {}, {{{x}, {y}}}, coefficients_{j}}};\n\n",
            number(a),
            number(b),
            number(c),
            number(d),
            number(plane.scale())
        );
    }
    out
}

pub(super) fn source(stored: &StoredModel, program: &Program, about: &About<'_>) -> String {
    let (name, dim) = (about.name, program.dim);
    let dof = dim / 2;
    let mut kernels = Kernels::new();
    let steps: String =
        program.functions.iter().map(|function| step(function, &mut kernels)).collect();
    let mut lines = about.lines.clone();
    lines.push(String::new());
    lines.push(format!("Compile with: cc -std=c99 -O2 -ffp-contract=off -c {name}.c"));
    lines.push(
        "and -mfma or -march=native where the processor has fused products; link -lm for fma."
            .into(),
    );
    let mut out = comment(&lines);
    let _ = write!(
        out,
        "#include \"{name}.h\"\n#include <float.h>\n#include <math.h>\n#include <stdint.h>\n#include <string.h>\n\n{HELPERS}\n"
    );
    if program.functions.iter().any(|function| !function.arguments.is_empty()) {
        out += "/* NaN where either is. */\nstatic inline double larger(double a, double b) {\n    \
                return (isnan(a) || b <= a) ? a : b;\n}\n\n";
    }
    kernels.iter().for_each(|(of, part)| out += &kernel(*of, *part));
    out += &array("table", &program.table);
    out += &steps;
    for (function, of) in [
        ("to_chart", &program.to_chart),
        ("step", &program.forward),
        ("step_back", &program.inverse),
        ("from_chart", &program.from_chart),
        ("tangent", &program.tangent),
    ] {
        out += &calls(function, of, program);
    }
    let planes: &[_] = stored.section.as_ref().map_or(&[], |section| section.planes());
    if !planes.is_empty() {
        out += &charts(planes);
    }
    let (mut to_units, mut from_units) = (String::new(), String::new());
    if let Some(units) = &stored.units {
        for (k, (centre, factor)) in units.centre().iter().zip(units.factors()).enumerate() {
            let (centre, factor) = (number(*centre), number(*factor));
            let _ = writeln!(to_units, "    z[{k}] = (z[{k}] - ({centre})) / {factor};");
            let _ = writeln!(from_units, "    z[{k}] = fma(z[{k}], {factor}, {centre});");
        }
    }
    let to_section = each_plane(stored, |j| {
        format!("chart_to_canonical(&chart_{j}, &z[{j}], &z[{}]);", dof + j)
    });
    let from_section =
        each_plane(stored, |j| format!("chart_to_data(&chart_{j}, &z[{j}], &z[{}]);", dof + j));
    let _ = write!(
        out,
        "/* From the coordinates of the data to those of the network, and back. */\n\
         static void to_network(double *z) {{\n    UNUSED(z);\n{to_section}{to_units}}}\n\n\
         static void to_data(double *z) {{\n    UNUSED(z);\n{from_units}{from_section}}}\n\n"
    );
    let _ = write!(
        out,
        "const char *{name}_digest(void) {{\n    return \"{}\";\n}}\n\n\
         void {name}_iterate(double z[{dim}], long long steps) {{\n    \
         if (steps == 0) {{\n        return;\n    }}\n    \
         to_network(z);\n    to_chart(z, 0);\n    \
         for (; steps > 0; steps--) {{\n        step(z, 0);\n    }}\n    \
         for (; steps < 0; steps++) {{\n        step_back(z, 0);\n    }}\n    \
         from_chart(z, 0);\n    to_data(z);\n}}\n\n\
         void {name}_map(double z[{dim}]) {{\n    {name}_iterate(z, 1);\n}}\n\n\
         void {name}_inverse(double z[{dim}]) {{\n    {name}_iterate(z, -1);\n}}\n\n",
        about.digest
    );
    out += &tangent_of_data(stored, name, dim);
    out += &is_inside(stored, name, dim);
    if let Some((to_actions, actions)) = &program.invariant {
        let inputs: Vec<String> = (0..dim).map(|k| format!("z[{k}]")).collect();
        let body = body(actions, &inputs, &mut kernels);
        out += &calls("to_actions", to_actions, program);
        let own = stored.units.is_none() && stored.section.is_none();
        let area = stored.units.as_ref().map_or(1.0, crate::phase::Units::area);
        let sum = body.name(actions.outputs[0]);
        let sum = if own { sum.to_owned() } else { format!("{} * {sum}", number(area)) };
        let _ = write!(
            out,
            "double {name}_invariant(const double at[{dim}]) {{\n    double z[{dim}];\n    \
             memcpy(z, at, sizeof z);\n    to_network(z);\n    to_actions(z, 0);\n{}    return {sum};\n}}\n",
            body.text
        );
    }
    out
}

/// A line for each plane with a chart, of its number.
fn each_plane(stored: &StoredModel, line: impl Fn(usize) -> String) -> String {
    let planes = stored.section.as_ref().map_or(&[][..], |section| section.planes());
    let with_chart = (0..planes.len()).filter(|j| planes[*j].is_some());
    with_chart.map(|j| format!("    {}\n", line(j))).collect()
}

/// The derivative in the coordinates of the data.
fn tangent_of_data(stored: &StoredModel, name: &str, dim: usize) -> String {
    let dof = dim / 2;
    let (mut to, mut from) = (String::new(), String::new());
    // δq = δy, δp = ∂p/∂x δx + ∂p/∂y δy.
    to += &each_plane(stored, |j| {
        let k = dof + j;
        format!(
            "chart_slopes(&chart_{j}, z[{j}], z[{k}], slopes);\n    w = v[{k}];\n    \
             v[{k}] = fma(slopes[0], v[{j}], slopes[1] * w);\n    v[{j}] = w;"
        )
    });
    for (k, factor) in stored.units.iter().flat_map(|units| units.factors().iter().enumerate()) {
        let factor = number(*factor);
        let _ = writeln!(to, "    v[{k}] = v[{k}] / {factor};");
        let _ = writeln!(from, "    v[{k}] = v[{k}] * {factor};");
    }
    from += &each_plane(stored, |j| {
        let k = dof + j;
        format!(
            "chart_slopes(&chart_{j}, z[{j}], z[{k}], slopes);\n    w = v[{j}];\n    \
             v[{j}] = fma(-slopes[1], w, v[{k}]) / slopes[0];\n    v[{k}] = w;"
        )
    });
    let declared = if stored.section.is_some() { "    double slopes[2], w;\n" } else { "" };
    format!(
        "void {name}_tangent(double z[{dim}], double v[{dim}]) {{\n    double both[{}];\n{declared}{to}    \
         to_network(z);\n    memcpy(both, z, {dim} * sizeof *z);\n    memcpy(both + {dim}, v, {dim} * sizeof *v);\n    \
         tangent(both, 0);\n    memcpy(z, both, {dim} * sizeof *z);\n    memcpy(v, both + {dim}, {dim} * sizeof *v);\n    \
         to_data(z);\n{from}}}\n\n",
        2 * dim
    )
}

fn is_inside(stored: &StoredModel, name: &str, dim: usize) -> String {
    let mut out = String::new();
    let mut region = String::new();
    if let Some(box_of_points) = &stored.provenance.region {
        let around = box_of_points.with_margin();
        out += "/* Whether a point is in the box of the training points. */\n";
        out += "static int is_in_region(const double *z) {\n    return ";
        let within = around.low.iter().zip(&around.high).enumerate().map(|(k, (low, high))| {
            format!("z[{k}] >= {} && z[{k}] <= {}", number(*low), number(*high))
        });
        out += &within.collect::<Vec<_>>().join("\n        && ");
        out += ";\n}\n\n";
        region =
            "    if (!is_in_region(at) || !is_in_region(z)) {\n        return 0;\n    }\n".into();
    }
    let most = number(1.0 + crate::network::Model::ROUNDING_OF_REACH);
    let _ = write!(
        out,
        "int {name}_is_inside(const double at[{dim}]) {{\n    double z[{dim}], reach = 0.0;\n    \
         memcpy(z, at, sizeof z);\n    to_network(z);\n    to_chart(z, &reach);\n    step(z, &reach);\n    \
         from_chart(z, &reach);\n    to_data(z);\n{region}    for (int k = 0; k < {dim}; k++) {{\n        \
         if (isnan(z[k])) {{\n            return 0;\n        }}\n    }}\n    return reach <= {most};\n}}\n\n"
    );
    out
}
