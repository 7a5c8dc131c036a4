//! What to cite.

use gyroceptron::flow::Integrator;
use gyroceptron::scene::Scene;

const CRATE: &str = concat!(
    "@software{gyroceptron,\n  title = {gyroceptron: symplectic gyroceptrons in Rust},\n  version = {",
    env!("CARGO_PKG_VERSION"),
    "},\n  year = {2026}\n}\n"
);

const PAPER: &str = "@article{DuruisseauxBurbyTang2023,
  author = {Duruisseaux, Valentin and Burby, Joshua W. and Tang, Qi},
  title = {Approximation of nearly-periodic symplectic maps via structure-preserving neural networks},
  journal = {Scientific Reports},
  volume = {13},
  pages = {8351},
  year = {2023},
  doi = {10.1038/s41598-023-34862-w}
}
";

const HENON: &str = "@article{BurbyTangMaulik2021,
  author = {Burby, Joshua W. and Tang, Qi and Maulik, Romit},
  title = {Fast neural {P}oincar\\'e maps for toroidal magnetic fields},
  journal = {Plasma Physics and Controlled Fusion},
  volume = {63},
  number = {2},
  pages = {024001},
  year = {2021},
  doi = {10.1088/1361-6587/abcbaa}
}
";

const LBFGS: &str = "@article{LiuNocedal1989,
  author = {Liu, Dong C. and Nocedal, Jorge},
  title = {On the limited memory {BFGS} method for large scale optimization},
  journal = {Mathematical Programming},
  volume = {45},
  pages = {503--528},
  year = {1989},
  doi = {10.1007/BF01589116}
}
";

const GAUSS: &str = "@book{HairerLubichWanner2006,
  author = {Hairer, Ernst and Lubich, Christian and Wanner, Gerhard},
  title = {Geometric Numerical Integration},
  edition = {2},
  publisher = {Springer},
  year = {2006},
  doi = {10.1007/3-540-30666-8}
}
";

const SPLITTINGS: &str = "@article{BlanesEtAl2013,
  author = {Blanes, Sergio and Casas, Fernando and Farr\\'es, Ariadna and Laskar, Jacques and Makazaga, Joseba and Murua, Ander},
  title = {New families of symplectic splitting methods for numerical integration in dynamical astronomy},
  journal = {Applied Numerical Mathematics},
  volume = {68},
  pages = {58--72},
  year = {2013},
  doi = {10.1016/j.apnum.2013.01.003}
}
";

const YOSHIDA: &str = "@article{Yoshida1990,
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

/// The entries for the program and, with a scene, for the methods it runs.
pub fn bibtex(scene: Option<&Scene>) -> String {
    let mut entries = vec![CRATE, PAPER];
    if let Some(scene) = scene {
        let any = |holds: &dyn Fn(&Scene) -> bool| holds(scene) || scene.parts.iter().any(holds);
        if any(&|own| !own.models.is_empty()) {
            entries.extend([HENON, LBFGS]);
        }
        if any(&|own| own.system.is_some()) {
            entries.push(GAUSS);
        }
        let runs = |own: &Scene, wanted: &[Integrator]| {
            let mut integrators = own.work_precision.iter().flat_map(|w| &w.integrators);
            integrators.any(|entry| wanted.contains(&entry.integrator))
        };
        if any(&|own| runs(own, &[Integrator::Aba864, Integrator::Aba1064])) {
            entries.push(SPLITTINGS);
        }
        if any(&|own| runs(own, &[Integrator::Yoshida4])) {
            entries.push(YOSHIDA);
        }
    }
    entries.join("\n")
}
