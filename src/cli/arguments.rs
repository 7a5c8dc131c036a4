//! The command line.

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use gyroceptron::Error;
use gyroceptron::layer::{CircleAction, TorusAction};
use gyroceptron::network::NamedArchitecture;
use gyroceptron::scalar::GridNumbers;
use gyroceptron::train::RampStage;
use std::ops::Range;
use std::path::PathBuf;

/// Symplectic gyroceptrons: train, certify and roll out nearly-periodic
/// symplectic maps. Without a command it runs the scene `quickstart`.
#[derive(Debug, Parser)]
#[command(name = "gyroceptron", version, args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub run: Run,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scene: data, training, certificate, roll-out, report.
    Run(Run),
    /// List the built-in scenes, a line each.
    Scenes {
        /// One JSON document instead of a table.
        #[arg(long)]
        json: bool,
        /// Print the file of this scene, to start your own from.
        #[arg(long, value_name = "SCENE")]
        show: Option<String>,
    },
    /// Certify the structure of a model, or of networks with random weights, at sampled points.
    Verify(Verify),
    /// Prove that a model has invariant circles that no orbit crosses.
    Prove(Prove),
    /// Verify a file of proofs again, without any search.
    CheckProof(CheckProof),
    /// Train a network on your own pairs.
    Train(Box<Train>),
    /// Fit a symplectic polynomial to your own pairs, without training.
    Fit(Fit),
    /// Roll a model out from given points.
    Predict(Predict),
    /// Make a model of weights trained elsewhere.
    Import(Import),
    /// Write a model for others: its weights, or the map as source code.
    Export(Export),
    /// Print what completes commands in a shell.
    Completions(Completions),
    /// Write manual pages, one for each command.
    Manual(Manual),
    /// What to cite, as BibTeX.
    Cite {
        /// A built-in scene, a .toml file, or a file of proofs.
        #[arg(value_name = "SCENE|FILE.toml|FILE.proof.json")]
        target: Option<String>,
    },
}

#[derive(Debug, Args)]
pub struct Run {
    /// A built-in scene or a .toml file.
    #[arg(value_name = "SCENE|FILE.toml")]
    pub scene: Option<String>,
    /// The folder to write to [default: gyroceptron-out/SCENE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The seed in place of the scene's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// A short form of the scene: fewer iterations, pairs and seeds.
    #[arg(long)]
    pub quick: bool,
    /// Weights or a model trained elsewhere, for scenes with a network that takes its own
    /// from a file, such as published-weights.
    #[arg(long, value_name = "FILE.safetensors|FILE.npz|FILE.index|FILE.json")]
    pub weights: Option<PathBuf>,
    #[command(flatten)]
    pub coils: CoilArguments,
    #[command(flatten)]
    pub common: Common,
    /// Go on with the run in the folder, from its last checkpoint.
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Replace the run in the folder; with --job the job of another scene in its place, with --merge the run or the
    /// report there.
    #[arg(long)]
    pub overwrite: bool,
    /// Print the jobs that the run consists of, a line of JSON each, for an engine that schedules; nothing is written.
    #[arg(
        help_heading = "Many machines",
        long,
        conflicts_with_all = ["job", "merge", "digest", "resume", "overwrite"]
    )]
    pub plan: bool,
    /// Leave out the seconds of the plan, for which each network is trained for a moment.
    #[arg(help_heading = "Many machines", long, requires = "plan")]
    pub no_estimate: bool,
    /// Do one job of the plan, in a folder of its own below that of the run.
    #[arg(
        help_heading = "Many machines",
        long,
        value_name = "ID",
        group = "piece",
        conflicts_with = "resume"
    )]
    pub job: Option<String>,
    /// Make the report when all jobs are done: the same as that of a run on one machine.
    #[arg(help_heading = "Many machines", long, group = "piece", conflicts_with = "resume")]
    pub merge: bool,
    /// Refuse the job, or the report, unless this is its digest in the plan.
    #[arg(help_heading = "Many machines", long, value_name = "DIGEST", requires = "piece")]
    pub digest: Option<String>,
}

/// The machine of a scene of field lines, such as `coils`.
#[derive(Debug, Args)]
pub struct CoilArguments {
    /// Coils of your own in place of the scene's: text with a line for each Fourier mode, and in it sine and cosine of
    /// x, of y and of z of one coil after another, in metres; or an .npz with points (C, N, 3), N of each of C coils.
    #[arg(help_heading = "Coils", long, value_name = "FILE", requires_all = ["currents", "field_periods"])]
    pub coils: Option<PathBuf>,
    /// The current of each coil of the file, in amperes.
    #[arg(
        help_heading = "Coils",
        long,
        value_name = "I,I,…",
        value_delimiter = ',',
        allow_negative_numbers = true,
        requires = "coils"
    )]
    pub currents: Vec<f64>,
    /// N, the field periods of the machine. The file holds the coils of one of them, or of half of one with stellarator
    /// symmetry; the others are turned images. Of the coils of a whole machine N is 1, with --asymmetric.
    #[arg(help_heading = "Coils", long, value_name = "N", requires = "coils")]
    pub field_periods: Option<u32>,
    /// Half a turn about the x axis is no symmetry of the machine: the coils of a whole period are in the file.
    #[arg(help_heading = "Coils", long, requires = "coils")]
    pub asymmetric: bool,
    /// Where the section is, in field periods: 0 and 0.5 are planes of symmetry.
    #[arg(help_heading = "Coils", long, value_name = "PERIODS", allow_negative_numbers = true)]
    pub section_at: Option<f64>,
    /// How far from the magnetic axis lines begin at most, in metres.
    #[arg(help_heading = "Coils", long, value_name = "METRES", allow_negative_numbers = true)]
    pub reach: Option<f64>,
    /// (R, Z) near the magnetic axis, in metres, where it is not found without.
    #[arg(
        help_heading = "Coils",
        long,
        value_name = "R,Z",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    pub axis: Vec<f64>,
}

#[derive(Clone, Debug, Args)]
pub struct Common {
    /// Threads to use [default: all]; the results do not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// One JSON document instead of tables.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct Verify {
    /// The file of the model to certify.
    #[arg(long, value_name = "FILE", conflicts_with = "random")]
    pub model: Option<PathBuf>,
    /// Values of controls of a model that depends on some, such as planar=0.02; the others are in the middle of their
    /// ranges.
    #[arg(long, value_name = "NAME=VALUE,…", value_delimiter = ',', requires = "model")]
    pub at: Vec<String>,
    /// Certify so many gyroceptrons with random weights [default: 10].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub random: Option<i64>,
    /// The number of points at which each model is tested.
    #[arg(long, value_name = "N", default_value_t = 200, allow_negative_numbers = true)]
    pub samples: i64,
    /// Points are uniform in |z_i| ≤ RADIUS; of a polynomial they are among its pairs.
    #[arg(long, default_value_t = 1.6, allow_negative_numbers = true)]
    pub radius: f64,
    /// The seed of points, angles and random weights.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Write the certificate as a page too.
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Replace an existing page.
    #[arg(long, requires = "report")]
    pub overwrite: bool,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub struct Prove {
    /// The model, of one degree of freedom.
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    /// Rotation numbers of circles, in turns a map and without whole turns: golden, 0.6180 (the number farthest from
    /// fractions that rounds to it), [0; 1, 2, (1)] (a continued fraction that ends in ones).
    #[arg(long, alias = "frequency", value_name = "OMEGA,…")]
    pub frequencies: Vec<String>,
    /// Two circles, and that no orbit between them ever leaves.
    #[arg(long, num_args = 2, value_names = ["OMEGA", "OMEGA"], conflicts_with = "frequencies")]
    pub between: Vec<String>,
    /// Where no frequency is given, so many that are spread over what the model has.
    #[arg(long, value_name = "N", default_value_t = 8, allow_negative_numbers = true)]
    pub circles: i64,
    /// Where the ray begins that circles are looked for on, in the coordinates of the normal form [default: the fixed
    /// point near 0].
    #[arg(long, value_name = "Q,P", value_delimiter = ',', allow_negative_numbers = true)]
    pub from: Vec<f64>,
    /// Where this ray ends, in the same coordinates.
    #[arg(
        long,
        value_name = "Q,P",
        value_delimiter = ',',
        allow_negative_numbers = true,
        default_value = "1,0"
    )]
    pub to: Vec<f64>,
    /// The file of the proofs [default: the model's name with .proof.json].
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace what is there.
    #[arg(long)]
    pub overwrite: bool,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub struct CheckProof {
    /// The file of proofs to check.
    #[arg(value_name = "FILE")]
    pub proof: PathBuf,
    /// The model that they are about.
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    #[command(flatten)]
    pub common: Common,
}

/// The names of architectures, each with what it is.
fn architectures() -> PossibleValuesParser {
    let value = |named: &NamedArchitecture| {
        PossibleValue::new(named.name).aliases(named.aliases).help(named.summary)
    };
    PossibleValuesParser::new(NamedArchitecture::ALL.iter().map(value))
}

/// What `train` does where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RecipeName {
    /// The recommended network and optimiser.
    Recommended,
    /// The gyroceptron of the paper, trained by L-BFGS.
    Paper,
}

/// The optimisers of `train` and of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OptimiserName {
    /// Levenberg–Marquardt.
    #[value(alias = "levenberg-marquardt")]
    Lm,
    /// L-BFGS in scaled variables.
    #[value(name = "l-bfgs", alias = "lbfgs")]
    Lbfgs,
    /// Adam on batches; an iteration is an epoch.
    Adam,
}

/// Whose units a network is trained in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum UnitsOf {
    /// Units fitted to the pairs.
    Fitted,
    /// The units of the data.
    Data,
}

#[derive(Clone, Debug, Args)]
pub struct Train {
    /// An .npz with `input` and `output`, both (N, 2n) float64, columns
    /// q1 … qn, p1 … pn; of a family of maps, `epsilon` and `flow_time` of each pair
    /// beside them, (N) float64.
    #[arg(long, value_name = "FILE.npz")]
    pub data: PathBuf,
    /// The integer weight of each plane (q_j, p_j), such as 1,0. Of several circles, each with
    /// an angle of its own, for a gyroceptron in normal form: such as 0,1,0/0,0,2. Or auto, found from
    /// the pairs where they are clear, of two planes by short trainings [default: auto].
    #[arg(long, value_name = "WEIGHTS", allow_hyphen_values = true)]
    pub circle_action: Option<String>,
    /// Network and training where no other option says so: recommended, a normal form by
    /// Levenberg–Marquardt from three initial weights until it is at rest, or that of the paper, its
    /// gyroceptron by L-BFGS [default: recommended].
    #[arg(long, value_enum, conflicts_with = "scene")]
    pub recipe: Option<RecipeName>,
    /// Network and training options are taken from this scene; the options below come
    /// before it.
    #[arg(long, value_name = "FILE.toml")]
    pub scene: Option<String>,
    /// The kind of network [default: the scene's, or that of the recipe].
    #[arg(long, value_parser = architectures())]
    pub architecture: Option<String>,
    /// Turned kicks of ψ_ε and their neurons, of a gyroceptron in normal form, such as 12x8; 12x8:arctan has neurons of
    /// arctan in place of tanh, of which a step takes half to three quarters of the time (so of all sizes here).
    #[arg(long, value_name = "LAYERSxWIDTH[:arctan|^DEGREE]")]
    pub kicks: Option<String>,
    /// Twist shears of T_ε and their neurons, of a gyroceptron in normal form, such as 16x8, or
    /// 20x2,10: 2 where they change positions, beside a quadratic form, and 10 where momenta.
    #[arg(long, value_name = "LAYERSxWIDTH[,WIDTH][:arctan|^DEGREE]")]
    pub twists: Option<String>,
    /// Turned twists of T_ε and their neurons, of a gyroceptron in normal form, such as 12x8: for slow
    /// motion whose average is no sum of a function of positions and one of momenta. With
    /// these alone given, there are no others.
    #[arg(long, value_name = "LAYERSxWIDTH[:arctan|^DEGREE]")]
    pub turned_twists: Option<String>,
    /// The flow time h of the model. With ε it scales T_ε of a gyroceptron in normal form, I_ε of one of couplings
    /// [default: how far the slow coordinates move, over ε]; pairs with flow times of
    /// their own are of maps of these times [default then: the longest].
    #[arg(long, allow_negative_numbers = true)]
    pub flow_time: Option<f64>,
    /// The box of polynomials, which sizes such as 10x1^16 ask for in place of neurons (10 layers of 1
    /// polynomial of degree 16): coordinates from −R to R, in units of the network [default: 1.1
    /// times the largest of the pairs].
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub radius: Option<f64>,
    /// A map that is reversible for all weights, S∘P∘S = P⁻¹: S changes the signs of the `positions` or of
    /// the `momenta`. It is A∘Φ_θ∘T_ε∘S∘A⁻¹∘S, A being the kicks and the perturbation, or the network.
    #[arg(long, value_name = "HALF")]
    pub reversor: Option<String>,
    /// Layers and neurons of ψ, such as 10x8.
    #[arg(long, value_name = "LAYERSxWIDTH[:arctan|^DEGREE]")]
    pub psi: Option<String>,
    /// Layers and neurons of I_ε, such as 10x8.
    #[arg(long, value_name = "LAYERSxWIDTH[:arctan|^DEGREE]")]
    pub near_identity: Option<String>,
    /// Turned kicks of a normal form that is nearly integrable, and their neurons: ε scales them
    /// alone. Give --epsilon of the perturbation; 0x8 is an integrable map.
    #[arg(long, value_name = "KICKSxWIDTH[:arctan|^DEGREE]")]
    pub perturbation: Option<String>,
    /// Layers and neurons of a HénonNet; linear modules and their shears of a SympNet.
    #[arg(long, value_name = "LAYERSxWIDTH[:arctan|^DEGREE]")]
    pub layers: Option<String>,
    /// What minimises the loss [default: the scene's, or that of the recipe].
    #[arg(long, value_enum)]
    pub optimiser: Option<OptimiserName>,
    /// Initial weights to begin from, 40 iterations each, of which the best goes on
    /// [default: the scene's, or that of the recipe].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub starts: Option<i64>,
    /// Stages before the training, of pairs with flow times of their own: the flow time and the
    /// iterations of each, such as 5x100,20x100. More can follow the flow time or take its place:
    /// @EPSILON takes the pairs of this ε; /M trains the first 1/M of the twists only, which are
    /// repeated M times after the ramp; ^DEGREE takes polynomials of at most this degree, such as
    /// ^4x50,^8x50.
    #[arg(long, value_name = "TIME[@EPSILON][/M][^DEGREE]xITERATIONS,…")]
    pub ramp: Option<String>,
    /// What is added to the loss: so many times the mean square of I_ε(z) − z, or of χ∘K_ε∘χ⁻¹(z) − z of a map with a
    /// perturbation.
    #[arg(long, value_name = "WEIGHT", allow_negative_numbers = true)]
    pub near_identity_penalty: Option<f64>,
    /// Weights of the planes in the loss and in the held-out error that chooses the model, scaled
    /// to mean 1: `auto` weighs each plane by its own motion beside the rotation, the inverse of
    /// its mean square; or n or 2n positive numbers, for the planes or for q1 … qn, p1 … pn;
    /// or `none` [default: those of the scene or the recipe, or auto].
    #[arg(long, value_name = "WEIGHTS", allow_hyphen_values = true)]
    pub loss_weights: Option<String>,
    /// Stop when the held-out error has not improved for so many evaluations of it, one
    /// in ten iterations; 0 never stops.
    #[arg(long, value_name = "N")]
    pub patience: Option<u64>,
    /// Stop when the held-out error has fallen by less than a tenth in so many iterations
    /// [default with --optimiser lm: 50]; 0 never stops.
    #[arg(long, value_name = "N")]
    pub plateau: Option<u64>,
    /// Stop when the held-out error is at most this.
    #[arg(long, value_name = "MSE", allow_negative_numbers = true)]
    pub target: Option<f64>,
    /// The folder of the report [default: the model's name and -report, beside it].
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// The model file to write; FILE.checkpoint beside it while training, and afterwards where
    /// the iterations were done and --resume can go on.
    #[arg(long, value_name = "FILE.json", default_value = "model.json")]
    pub output: PathBuf,
    /// ε of the near-identity part [default: that of the pairs with the largest magnitude, or 0.01].
    #[arg(long, allow_negative_numbers = true)]
    pub epsilon: Option<f64>,
    /// θ to start from, in radians [default: the rotation nearest to the data].
    #[arg(long, allow_negative_numbers = true)]
    pub theta: Option<f64>,
    /// Leave θ as it is at the start: where the frequency of the limit is known, so that I_ε
    /// does not take a part of the rotation from it, nor it from I_ε.
    #[arg(long)]
    pub theta_fixed: bool,
    /// What is added to the loss: so many times the square of how far θ is from its start.
    #[arg(long, value_name = "WEIGHT", allow_negative_numbers = true)]
    pub theta_penalty: Option<f64>,
    /// The largest number of iterations [default: 1000, or the scene's]. Each of several starts takes 40 of its own
    /// first, whatever this number is.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub iterations: Option<i64>,
    /// The share of the pairs to hold out.
    #[arg(long, default_value_t = 0.1, allow_negative_numbers = true)]
    pub validation: f64,
    /// The units that the network is trained in: ones in which the pairs are of order one and
    /// turn in circles, kept with the model and undone wherever it is used, or those of the data.
    #[arg(long, value_enum, default_value_t = UnitsOf::Fitted)]
    pub units: UnitsOf,
    /// Of pairs whose columns x, y have the area form ρ dx∧dy, such as R, Z of a magnetic field with ρ = B_φ: an .npz
    /// file of ρ on a grid, with arrays x, y and density (a row for each y); of several planes with arrays x1, y1,
    /// density1, x2 and so on, where planes without them are canonical (and planes, their number, where the last is);
    /// of a ρ that depends on controls, linearly, with a grid for each row of an array lambda, whose columns are
    /// those of --controls. The model is trained in canonical coordinates, keeps the chart, and predicts x, y.
    #[arg(long, value_name = "FILE.npz")]
    pub section: Option<PathBuf>,
    /// The names of the controls that the pairs depend on, whose values are the columns of the array `lambda`
    /// [default: lambda, or lambda1, lambda2 and so on].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub controls: Vec<String>,
    /// The total degree of the polynomials that parameters are of the controls [default: the highest up to 4 of which
    /// there are fewer terms than values to learn].
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    pub control_degree: Option<i64>,
    /// The seed of weights and of the held-out choice.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Go on from FILE.checkpoint.
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Replace an existing model file, and its report.
    #[arg(long)]
    pub overwrite: bool,
    #[command(flatten)]
    pub common: Common,
}

impl Train {
    /// The sizes of parts that are given, with the key of each.
    pub fn sizes(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let given = [
            ("psi", &self.psi),
            ("near_identity", &self.near_identity),
            ("kicks", &self.kicks),
            ("twists", &self.twists),
            ("turned_twists", &self.turned_twists),
            ("perturbation", &self.perturbation),
            ("layers", &self.layers),
        ];
        given.into_iter().filter_map(|(key, text)| Some((key, text.as_deref()?)))
    }
}

/// The word for a value of an option.
pub fn word_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |word| word.get_name().to_owned())
}

/// The option of a key: `--near-identity` of `near_identity`.
pub fn option_of(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

#[derive(Debug, Args)]
pub struct Fit {
    /// An .npz with `input` and `output`, both (N, 2n) float64, columns q1 … qn, p1 … pn, of one map with n ≤ 4.
    #[arg(long, value_name = "FILE.npz")]
    pub data: PathBuf,
    /// The total degree of the generating function [default: raised from 2 on until the error on held-out pairs falls
    /// no more by a tenth].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub degree: Option<i64>,
    /// The map is reversible, S∘P∘S = P⁻¹, where S changes the signs of the `positions` or of the `momenta`: about half
    /// the coefficients.
    #[arg(long, value_name = "HALF")]
    pub reversor: Option<String>,
    /// The map commutes with the reflection (q, p) ↦ (−q, −p) of these planes, 2 being that of q2 and p2: about half
    /// the coefficients. So does the map of a ring without skew fields, with its vertical plane.
    #[arg(long, value_name = "PLANE,…", value_delimiter = ',', allow_negative_numbers = true)]
    pub mirrored: Vec<i64>,
    /// Of pairs whose columns x, y have the area form ρ dx∧dy: the file of ρ, as for `train`, without controls.
    #[arg(long, value_name = "FILE.npz")]
    pub section: Option<PathBuf>,
    /// The share of the pairs to hold out.
    #[arg(long, default_value_t = 0.1, allow_negative_numbers = true)]
    pub validation: f64,
    /// The seed of the held-out choice.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// The file to write, a model for `predict`.
    #[arg(long, value_name = "FILE.json")]
    pub output: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    #[command(flatten)]
    pub common: Common,
}

/// What to do with trajectories that leave the box of the training points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Outside {
    /// Say which, and write them.
    Warn,
    /// Say which, write nothing, and end with status 1.
    Stop,
    /// Write them without a warning.
    Ignore,
}

/// How places on a grid are written: see [`GridNumbers`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum GridKind {
    /// Multiples of the spacing, as 64-bit integers.
    Integers,
    /// f64 that stay on the grid.
    Floats,
}

impl From<GridKind> for GridNumbers {
    fn from(kind: GridKind) -> Self {
        match kind {
            GridKind::Integers => Self::Integers,
            GridKind::Floats => Self::Floats,
        }
    }
}

#[derive(Debug, Args)]
pub struct Predict {
    /// The model, or the polynomial of `fit`.
    #[arg(long, value_name = "FILE.json")]
    pub model: PathBuf,
    /// Initial points, an .npy of (M, 2n) float64.
    #[arg(long, value_name = "FILE.npy")]
    pub input: PathBuf,
    /// Another ε than the model's, for one that has learnt several.
    #[arg(long, allow_negative_numbers = true)]
    pub epsilon: Option<f64>,
    /// Another flow time than the model's, for one that has learnt several.
    #[arg(long, allow_negative_numbers = true)]
    pub flow_time: Option<f64>,
    /// Values of controls of a model that depends on some, such as planar=0.02; the others are in the middle of their
    /// ranges.
    #[arg(long, value_name = "NAME=VALUE,…", value_delimiter = ',')]
    pub at: Vec<String>,
    /// Applications of the map, or of its inverse: of -1000, a thousand steps back.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub steps: i64,
    /// Round every increment to a grid of 2^-BITS in the network's coordinates, so that as many steps back
    /// lead to the first state, bit for bit. Of networks whose steps are shears: no twists, no couplings.
    #[arg(long, value_name = "BITS", allow_negative_numbers = true)]
    pub grid: Option<i64>,
    /// What holds the places of the grid: integers of 64 bits, which wrap, or floats, which are a little faster and
    /// stop where an orbit leaves their range.
    #[arg(long, value_enum, requires = "grid", default_value_t = GridKind::Integers)]
    pub grid_numbers: GridKind,
    /// Keep one state in so many.
    #[arg(long, value_name = "K", default_value_t = 1, allow_negative_numbers = true)]
    pub every: i64,
    /// Only block K of N of the initial points, which follow one another: the numbers are those of a call for all.
    #[arg(long, value_name = "K/N")]
    pub block: Option<String>,
    /// The trajectories, an .npy of (steps/every + 1, M, 2n).
    #[arg(long, value_name = "FILE.npy")]
    pub output: PathBuf,
    /// Trajectories to compare with, such as those of an integrator, an .npy of the shape of the output: how far apart
    /// they are is printed.
    #[arg(long, value_name = "FILE.npy")]
    pub compare: Option<PathBuf>,
    /// The invariant of the network along them, an .npy of (steps/every + 1, M): 𝔍₀∘ψ⁻¹ of a
    /// gyroceptron, the sum of the actions of one in normal form.
    #[arg(long, value_name = "FILE.npy")]
    pub invariant: Option<PathBuf>,
    /// What to do with kept states outside the box of the training points, or outside that of the
    /// network's polynomials, if it has any, and with values of controls, ε or a flow time that the model has not
    /// learnt.
    #[arg(long, value_enum, default_value_t = Outside::Warn)]
    pub outside: Outside,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub struct Import {
    /// The tensors, under the names of the guide (`src/guide/program.md`), or the index of a TensorFlow
    /// checkpoint of the published code.
    #[arg(long, value_name = "FILE.safetensors|FILE.npz|FILE.index")]
    pub weights: PathBuf,
    /// The integer weight of each plane (q_j, p_j), such as 1,0; of several circles such as
    /// 0,1,0/0,0,2. A file of `export` says it.
    #[arg(long, value_name = "WEIGHTS", allow_hyphen_values = true)]
    pub circle_action: Option<String>,
    /// ε of the near-identity part. A file of `export` says it.
    #[arg(long, allow_negative_numbers = true)]
    pub epsilon: Option<f64>,
    /// The flow time h, where the weights are of a gyroceptron in normal form or of couplings. A file of `export` says
    /// it.
    #[arg(long, allow_negative_numbers = true)]
    pub flow_time: Option<f64>,
    /// The model file to write.
    #[arg(long, value_name = "FILE.json")]
    pub output: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    /// One JSON document instead of a line.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct Completions {
    /// The shell: its documentation says where the text belongs.
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub struct Manual {
    /// The folder to write to, such as ~/.local/share/man/man1.
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
    /// Replace pages that are there.
    #[arg(long)]
    pub overwrite: bool,
}

/// The formats that `export` writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// Weights as safetensors.
    Safetensors,
    /// Weights as arrays of NumPy.
    Npz,
    /// The map in C99: FILE.c, FILE.h, and FILE.f90 for Fortran.
    C,
    /// The map in Python, of arrays of JAX.
    Jax,
    /// The map in Python, of tensors of PyTorch.
    Torch,
}

impl ExportFormat {
    /// The ending of the file.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Safetensors => "safetensors",
            Self::Npz => "npz",
            Self::C => "c",
            Self::Jax | Self::Torch => "py",
        }
    }
}

#[derive(Debug, Args)]
pub struct Export {
    /// The file of the model to export.
    #[arg(long, value_name = "FILE.json")]
    pub model: PathBuf,
    /// The file to write.
    #[arg(long, value_name = "FILE.safetensors|FILE.npz|FILE.c|FILE.py")]
    pub output: PathBuf,
    /// What to write [default: by the ending of the file, and jax for .py].
    #[arg(long, value_enum)]
    pub format: Option<ExportFormat>,
    /// Another ε than the model's in source code, for one that has learnt several.
    #[arg(long, allow_negative_numbers = true)]
    pub epsilon: Option<f64>,
    /// Another flow time than the model's in source code, for one that has learnt several.
    #[arg(long, allow_negative_numbers = true)]
    pub flow_time: Option<f64>,
    /// Values of controls in source code, of a model that depends on some, such as planar=0.02; the others are in the
    /// middle of their ranges.
    #[arg(long, value_name = "NAME=VALUE,…", value_delimiter = ',')]
    pub at: Vec<String>,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    /// One JSON document instead of a line.
    #[arg(long)]
    pub json: bool,
}

/// `1,0` as a circle action, `0,1,0/0,0,2` as one of two circles.
pub fn circle_action(text: &str) -> Result<TorusAction, Error> {
    let circle = |text: &str| {
        let weights: Result<Vec<i32>, _> =
            text.split(',').map(|part| part.trim().parse()).collect();
        weights.map(CircleAction::new)
    };
    let circles: Result<Vec<_>, _> = text.split('/').map(circle).collect();
    let circles = circles.map_err(|_| {
        Error::invalid("--circle-action", text, "integers with commas, such as 1,0")
    })?;
    TorusAction::new(circles).map_err(|e| e.with_place("--circle-action"))
}

/// `5x100,20x100`, `@0.1x100`, `5/2x100` or `^4x50,^8x50` as stages of a ramp.
pub fn ramp(name: &str, text: &str) -> Result<Vec<RampStage>, Error> {
    const MARKS: [char; 3] = ['@', '/', '^'];
    let stage = |text: &str| {
        let (place, iterations) = text.rsplit_once('x')?;
        let (time, mut rest) = place.split_at(place.find(MARKS).unwrap_or(place.len()));
        if place.trim().is_empty() {
            return None;
        }
        let time = Some(time.trim()).filter(|time| !time.is_empty());
        let mut stage = RampStage {
            flow_time: time.map(str::parse).transpose().ok()?,
            epsilon: None,
            repeats: None,
            degree: None,
            iterations: iterations.trim().parse().ok()?,
        };
        while let Some(mark) = rest.chars().next() {
            let own = &rest[1..];
            let (value, next) = own.split_at(own.find(MARKS).unwrap_or(own.len()));
            let value = value.trim();
            match mark {
                '@' if stage.epsilon.is_none() => stage.epsilon = Some(value.parse().ok()?),
                '/' if stage.repeats.is_none() => stage.repeats = Some(value.parse().ok()?),
                '^' if stage.degree.is_none() => stage.degree = Some(value.parse().ok()?),
                _ => return None,
            }
            rest = next;
        }
        Some(stage)
    };
    let expected = "flow times and iterations, such as 5x100,20x100, with @EPSILON, /M or ^DEGREE after the flow time \
                    or in its place, such as 5/2x100 or ^4x50,^8x50";
    text.split(',')
        .map(|text| stage(text).ok_or_else(|| Error::invalid(name, text, expected)))
        .collect()
}

/// The rows of block K of N, of so many rows: all that follow one another, and no two blocks differ by more than a row.
pub fn block(text: &str, rows: usize) -> Result<Range<usize>, Error> {
    let invalid = |expected: &str| Error::invalid("--block", text, expected);
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    let (number, count): (u64, u64) = numbers.ok_or_else(|| invalid("K/N, such as 3/8"))?;
    if !(1..=count).contains(&number) {
        return Err(invalid("K from 1 to N"));
    }
    if count > rows as u64 {
        return Err(invalid(&format!("at most {rows} blocks, one for each initial point")));
    }
    // Both are at most `rows`, a count of numbers in memory.
    let start = |number: u64| (u128::from(number) * rows as u128 / u128::from(count)) as usize;
    Ok(start(number - 1)..start(number))
}

/// A count that must be at least 1.
pub fn positive(name: &str, value: i64) -> Result<usize, Error> {
    usize::try_from(value)
        .ok()
        .filter(|v| *v > 0)
        .ok_or_else(|| Error::invalid(name, value, "at least 1"))
}
