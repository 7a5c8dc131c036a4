//! P⁻¹∘P = P∘P⁻¹ = Id, for networks, their parts, every layer alone and the
//! single Hénon map alone; that map's symplecticity, in which its sign shows.

use crate::samples::{Case, wide};
use crate::suite;
use crate::watched::{Watched, watched};
use gyroceptron::layer::HenonMap;
use gyroceptron::measure::{
    Measurable,
    certificate::{Row, Tally},
    laws,
};
use gyroceptron::network::Part;
use gyroceptron::phase::Direction;
use std::sync::OnceLock;

pub const STATED: usize = 2000;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| suite::run("inversion", STATED / 2, wide(1, 40), measure))
}

fn seen<T>(map: T) -> Watched<T> {
    watched("inversion", map)
}

fn measure(case: &Case) -> Vec<Tally> {
    let points = &case.points(2);
    let (model, network) = (case.model(), case.gyroceptron());
    let (psi, near_identity) = (network.psi(), network.near_identity());
    let (forward, inverse) = (Direction::Forward, Direction::Inverse);
    let alone = |map: &dyn Measurable, law, equation| {
        laws::inversion(law, equation, &seen(map), forward, points)
    };
    let mut out = vec![
        laws::inversion("inversion of P", "P⁻¹∘P = Id", &seen(&model), forward, points),
        laws::inversion("inversion of P", "P∘P⁻¹ = Id", &seen(&model), inverse, points),
        alone(&psi, "inversion of ψ", "ψ⁻¹∘ψ = Id"),
        alone(&near_identity, "inversion of I_ε", "I_ε⁻¹∘I_ε = Id"),
    ];
    out.extend(laws::layers(&seen(&model), points));
    let of = |part| model.henon_layers(part).take(2);
    for layer in of(Part::Conjugation).chain(of(Part::NearIdentity)) {
        let map: HenonMap<'_, f64> = layer.map();
        out.push(alone(&map, "inversion of H", "H⁻¹∘H = Id"));
        out.push(laws::symplecticity_of("symplecticity of H", &seen(&map), points));
    }
    out
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}
