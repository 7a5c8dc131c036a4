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
mod orbits;
mod polynomial_family;
mod polynomial_map;
mod polynomial_on_section;
mod product_basis;
mod reference;
mod region;
mod request;
mod runge_kutta;
mod splitting;
mod step_table;
mod stroboscopic;
mod symplectic_polynomial;
mod tableau;
mod tabulated_lines;
mod trajectories;

pub use averaged::Averaged;
pub use charged::{boris, velocity_splitting};
#[cfg(feature = "files")]
pub(crate) use data::check_finite;
pub use data::{Condition, Pairs, Window, sample, sample_of};
pub use field_line::LineMap;
pub use gauss::GaussLegendre;
#[cfg(feature = "scenes")]
pub(crate) use integrator::whole_periods;
pub use integrator::{Integrator, MicroSteps};
pub use line_section::{LineRequest, LineSection};
pub use multi_revolution::MultiRevolution;
pub use orbits::orbits_of;
pub use polynomial_family::PolynomialFamily;
pub use polynomial_map::{FormDefect, PolynomialMap, TwoFits};
pub use polynomial_on_section::PolynomialOnSection;
pub use reference::{Reference, ReferenceValue};
pub use region::{Exit, OutsidePolynomials, OutsideRegion, PolynomialExit, Region, RegionExit};
pub use runge_kutta::{natural_runge_kutta_4, runge_kutta_4};
pub use splitting::{Splitting, SplittingSteps};
pub use step_table::{FlowOfPoints, StepTable, TableKind};
pub use stroboscopic::Stroboscopic;
pub use symplectic_polynomial::{Symmetries, SymplecticPolynomial};
pub use tableau::Tableau;
pub use tabulated_lines::TabulatedLines;
pub use trajectories::{ReferenceTrajectories, Trajectories};
