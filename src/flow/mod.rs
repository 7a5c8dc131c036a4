//! Flows of the systems: splittings, Runge–Kutta, the reference, and data.

mod averaged;
mod charged;
mod collocation;
mod data;
mod field_line;
mod gauss;
mod integrator;
mod lane_map;
mod line_section;
mod multi_revolution;
mod natural;
mod numerical_method;
mod orbits;
mod parts;
mod polynomial_family;
mod polynomial_map;
mod polynomial_on_section;
mod product_basis;
mod reference;
mod region;
mod request;
mod runge_kutta;
mod splitting;
mod splitting_on_points;
mod step_table;
mod stroboscopic;
mod symmetries;
mod symplectic_frame;
mod symplectic_polynomial;
mod symplectic_start;
mod tableau;
mod tabulated_lines;
mod trajectories;

pub(crate) use averaged::integral_weights;
pub use averaged::{Averaged, AveragedSettings};
pub use charged::{boris, velocity_splitting};
pub use collocation::GaussLegendreSettings;
#[cfg(feature = "files")]
pub(crate) use data::check_finite;
pub use data::{Condition, Pairs, Window, sample, sample_of};
pub use field_line::LineMap;
pub use gauss::GaussLegendre;
pub use integrator::Integrator;
#[cfg(feature = "scenes")]
pub(crate) use integrator::whole_periods;
pub use line_section::{LineRequest, LineSection, turns_of_trace};
pub use multi_revolution::{MultiRevolution, MultiRevolutionSettings};
pub use orbits::orbits_of;
pub use polynomial_family::PolynomialFamily;
pub use polynomial_map::{FormDefect, PolynomialMap, TwoFits};
pub use polynomial_on_section::PolynomialOnSection;
pub use reference::{Reference, ReferenceValue};
pub(crate) use region::lose_rest;
pub use region::{
    Exit, OutsidePolynomials, OutsideRegion, OutsideSection, PolynomialExit, Region, RegionExit,
    SectionExit,
};
pub use runge_kutta::{natural_runge_kutta_4, runge_kutta_4};
pub use splitting::{MicroSteps, Splitting, SplittingSteps};
pub use step_table::{FlowOfPoints, StepTable, TableKind};
pub use stroboscopic::{Stroboscopic, StroboscopicSettings};
pub use symmetries::Symmetries;
pub use symplectic_polynomial::SymplecticPolynomial;
pub use tableau::Tableau;
pub use tabulated_lines::TabulatedLines;
pub use trajectories::{ReferenceTrajectories, Trajectories};
