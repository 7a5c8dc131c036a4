//! Explicit Runge–Kutta methods by their tableaux, in steps of one size: that of order 8 of Dormand and Prince.

use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use super::runge_kutta::{Canonical, Field, Natural};
use crate::error::Error;
use crate::scalar::{Elementary, Pack};
use crate::system::{Hamiltonian, NaturalCoordinates, System, each_system};

/// The coefficients of an explicit Runge–Kutta method, without those that are 0.
#[derive(Clone, Copy, Debug)]
pub struct Tableau<'a> {
    /// c_i, and (j, a_ij) for stages j before.
    pub stages: &'a [(f64, &'a [(usize, f64)])],
    /// The pairs (i, b_i) of a stage i and its weight b_i, where this is not 0.
    pub weights: &'a [(usize, f64)],
}

/// c_i, and a_ij where they are not 0.
const STAGES: [(f64, &[(usize, f64)]); 12] = [
    (0.0, &[]),
    (0.052_600_151_958_767_73, &[(0, 0.052_600_151_958_767_73)]),
    (0.078_900_227_938_151_6, &[(0, 0.019_725_056_984_537_9), (1, 0.059_175_170_953_613_7)]),
    (0.118_350_341_907_227_4, &[(0, 0.029_587_585_476_806_85), (2, 0.088_762_756_430_420_54)]),
    (
        0.281_649_658_092_772_6,
        &[(0, 0.241_365_134_159_266_7), (2, -0.884_549_479_328_286_1), (3, 0.924_834_003_261_792)],
    ),
    (
        0.333_333_333_333_333_3,
        &[
            (0, 0.037_037_037_037_037_035),
            (3, 0.170_828_608_729_473_86),
            (4, 0.125_467_687_566_822_42),
        ],
    ),
    (
        0.25,
        &[
            (0, 0.037_109_375),
            (3, 0.170_252_211_019_544_05),
            (4, 0.060_216_538_980_455_96),
            (5, -0.017_578_125),
        ],
    ),
    (
        0.307_692_307_692_307_7,
        &[
            (0, 0.037_092_000_118_504_79),
            (3, 0.170_383_925_712_239_98),
            (4, 0.107_262_030_446_373_28),
            (5, -0.015_319_437_748_624_402),
            (6, 0.008_273_789_163_814_023),
        ],
    ),
    (
        0.651_282_051_282_051_3,
        &[
            (0, 0.624_110_958_716_075_7),
            (3, -3.360_892_629_446_941_4),
            (4, -0.868_219_346_841_726),
            (5, 27.592_099_699_446_71),
            (6, 20.154_067_550_477_894),
            (7, -43.489_884_181_069_96),
        ],
    ),
    (
        0.6,
        &[
            (0, 0.477_662_536_438_264_34),
            (3, -2.488_114_619_971_667_7),
            (4, -0.590_290_826_836_843),
            (5, 21.230_051_448_181_193),
            (6, 15.279_233_632_882_423),
            (7, -33.288_210_968_984_86),
            (8, -0.020_331_201_708_508_627),
        ],
    ),
    (
        0.857_142_857_142_857_1,
        &[
            (0, -0.937_142_430_085_987_3),
            (3, 5.186_372_428_844_064),
            (4, 1.091_437_348_996_729_5),
            (5, -8.149_787_010_746_927),
            (6, -18.520_065_659_996_96),
            (7, 22.739_487_099_350_505),
            (8, 2.493_605_552_679_652_3),
            (9, -3.046_764_471_898_219_6),
        ],
    ),
    (
        1.0,
        &[
            (0, 2.273_310_147_516_538),
            (3, -10.534_495_466_737_25),
            (4, -2.000_872_058_224_862_5),
            (5, -17.958_931_863_118_8),
            (6, 27.948_884_529_419_96),
            (7, -2.858_998_277_135_023_5),
            (8, -8.872_856_933_530_63),
            (9, 12.360_567_175_794_303),
            (10, 0.643_392_746_015_763_6),
        ],
    ),
];

/// b_i where they are not 0.
const WEIGHTS: &[(usize, f64)] = &[
    (0, 0.054_293_734_116_568_765),
    (5, 4.450_312_892_752_409),
    (6, 1.891_517_899_314_500_3),
    (7, -5.801_203_960_010_585),
    (8, 0.311_164_366_957_819_9),
    (9, -0.152_160_949_662_516_1),
    (10, 0.201_365_400_804_030_34),
    (11, 0.044_710_615_727_772_59),
];

impl Tableau<'_> {
    /// The method of order 8 and twelve stages behind DOP853.
    ///
    /// Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.5 and II.10,
    /// <https://doi.org/10.1007/978-3-540-78862-1>.
    pub const DORMAND_PRINCE_8: Tableau<'static> = Tableau { stages: &STAGES, weights: WEIGHTS };

    /// z ← the flow over `time`, in `steps` equal steps. Not symplectic.
    ///
    /// # Panics
    /// When `steps` is 0, z is not of 2n numbers, or a stage refers to one that does not precede it.
    #[inline(always)]
    pub fn take<S: Elementary>(
        &self,
        system: &impl Hamiltonian,
        z: &mut [S],
        time: f64,
        steps: usize,
    ) {
        assert!(z.len() == 2 * system.dof());
        self.of_field(&Canonical(system), z, time, steps);
    }

    /// [`Tableau::take`] in the natural coordinates x of a system that has some: x ← the flow.
    ///
    /// # Panics
    /// As [`Tableau::take`].
    #[inline(always)]
    pub fn take_natural<S: Elementary>(
        &self,
        system: &impl NaturalCoordinates,
        x: &mut [S],
        time: f64,
        steps: usize,
    ) {
        assert!(x.len() == 2 * system.dof());
        self.of_field(&Natural(system), x, time, steps);
    }

    /// x ← the flow of a field.
    #[inline(always)]
    pub(super) fn of_field<S: Elementary>(
        &self,
        field: &impl Field,
        z: &mut [S],
        time: f64,
        steps: usize,
    ) {
        assert!(steps > 0);
        let (h, dim) = (time / steps as f64, z.len());
        let mut slopes = vec![S::zero(); (self.stages.len() + 1) * dim];
        let (stage, slopes) = slopes.split_at_mut(dim);
        let advance = |from: &[S], shares: &[(usize, f64)], slopes: &[S], to: &mut [S]| {
            to.copy_from_slice(from);
            for &(of, share) in shares {
                let share = S::from_f64(share * h);
                for (to, slope) in to.iter_mut().zip(&slopes[of * dim..(of + 1) * dim]) {
                    *to = share.mul_add(*slope, *to);
                }
            }
        };
        for step in 0..steps {
            let start = step as f64 * h;
            for (number, (node, shares)) in self.stages.iter().enumerate() {
                let (known, slope) = slopes.split_at_mut(number * dim);
                advance(z, shares, known, stage);
                field.at(stage, start + node * h, &mut slope[..dim]);
            }
            advance(z, self.weights, slopes, stage);
            z.copy_from_slice(stage);
        }
    }
}

/// The method of order 8.
pub(super) const DORMAND_PRINCE: &str = "@book{HairerNorsettWanner1993,
  author = {Hairer, Ernst and N{\\o}rsett, Syvert P. and Wanner, Gerhard},
  title = {Solving Ordinary Differential Equations {I}: Nonstiff Problems},
  edition = {2},
  publisher = {Springer},
  year = {1993},
  doi = {10.1007/978-3-540-78862-1}
}
";

/// The integrator of scenes that takes steps of [`Tableau::DORMAND_PRINCE_8`].
pub(super) struct DormandPrince8;

impl NumericalMethod for DormandPrince8 {
    fn name(&self) -> String {
        "Dormand–Prince 8".into()
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(DORMAND_PRINCE)
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let method = Explicit { tableau: Tableau::DORMAND_PRINCE_8 };
        each_system!(system, system => request.step(&method, system, initial))
    }
}

/// By a tableau, which is known when it runs: of a constant one each stage would be compiled by itself.
struct Explicit {
    tableau: Tableau<'static>,
}

impl<H: Hamiltonian> Method<H> for Explicit {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: &[()], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            self.tableau.take(system, z, interval, steps);
        }
    }
}
