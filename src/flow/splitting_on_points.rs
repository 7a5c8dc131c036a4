//! Splittings of scenes, on many points.

use super::numerical_method::NumericalMethod;
use super::parts::{check_parts, each_splittable};
use super::request::Request;
use super::{MultiRevolution, Splitting};
use crate::error::Error;
use crate::system::System;

/// The BibTeX entry of the article on the splittings ABA(8,6,4) and ABA(10,6,4).
const NESTED_SPLITTINGS: &str = "@article{BlanesEtAl2013,
  author = {Blanes, Sergio and Casas, Fernando and Farr\\'es, Ariadna and Laskar, Jacques and Makazaga, Joseba and Murua, Ander},
  title = {New families of symplectic splitting methods for numerical integration in dynamical astronomy},
  journal = {Applied Numerical Mathematics},
  volume = {68},
  pages = {58--72},
  year = {2013},
  doi = {10.1016/j.apnum.2013.01.003}
}
";

/// The splitting of order 4.
const TRIPLE_JUMP: &str = "@article{Yoshida1990,
  author = {Yoshida, Haruo},
  title = {Construction of higher order symplectic integrators},
  journal = {Physics Letters A},
  volume = {150},
  number = {5--7},
  pages = {262--268},
  year = {1990},
  doi = {10.1016/0375-9601(90)90092-3}
}
";

impl NumericalMethod for Splitting {
    fn name(&self) -> String {
        self.name.into()
    }

    fn bibtex(&self) -> Option<&'static str> {
        match *self {
            Self::YOSHIDA_4 => Some(TRIPLE_JUMP),
            Self::ABA_864 | Self::ABA_1064 => Some(NESTED_SPLITTINGS),
            _ => None,
        }
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        check_parts(self, system)
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        Error::check_count_range("steps", request.steps, 1, usize::MAX)?;
        each_splittable!(self, system, system => {
            let steps = self.steps(system, request.interval / request.steps as f64);
            let method = MultiRevolution::of_steps(steps, request.steps);
            request.step(&method, system, initial)
        })
    }
}
