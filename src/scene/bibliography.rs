//! BibTeX entries of the methods that studies use.

/// The BibTeX entry for Hénon layers and HénonNets.
pub(super) const HENON_NET: &str = "@article{BurbyTangMaulik2021,
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

/// The BibTeX entry for SympNets of linear and activation modules (LA-SympNets).
pub(super) const SYMP_NET: &str = "@article{JinEtAl2020,
  author = {Jin, Pengzhan and Zhang, Zhen and Zhu, Aiqing and Tang, Yifa and Karniadakis, George Em},
  title = {{SympNets}: Intrinsic structure-preserving symplectic networks for identifying {H}amiltonian systems},
  journal = {Neural Networks},
  volume = {132},
  pages = {166--179},
  year = {2020},
  doi = {10.1016/j.neunet.2020.08.017}
}
";

/// The BibTeX entry for affine coupling layers.
pub(super) const COUPLINGS: &str = "@inproceedings{DinhEtAl2017,
  author = {Dinh, Laurent and Sohl-Dickstein, Jascha and Bengio, Samy},
  title = {Density estimation using {Real} {NVP}},
  booktitle = {5th International Conference on Learning Representations},
  year = {2017},
  url = {https://arxiv.org/abs/1605.08803}
}
";

/// Kicks by polynomials along lines.
pub(super) const JOLTS: &str = "@incollection{DragtAbell1996,
  author = {Dragt, Alex J. and Abell, Dan T.},
  title = {Symplectic maps and computation of orbits in particle accelerators},
  booktitle = {Integration Algorithms and Classical Mechanics},
  series = {Fields Institute Communications},
  volume = {10},
  publisher = {American Mathematical Society},
  year = {1996}
}
";

/// Exact bijections of a grid.
pub(super) const GRIDS: &str = "@article{ReinTamayo2018,
  author = {Rein, Hanno and Tamayo, Daniel},
  title = {{JANUS}: a bit-wise reversible integrator for {N}-body dynamics},
  journal = {Monthly Notices of the Royal Astronomical Society},
  volume = {473},
  year = {2018},
  eprint = {1704.07715},
  archivePrefix = {arXiv}
}
";

/// Invariant circles that numbers prove.
pub(super) const PROVED_CIRCLES: &str = "@article{FiguerasHaroLuque2017,
  author = {Figueras, Jordi-Llu{\\'\\i}s and Haro, Alex and Luque, Alejandro},
  title = {Rigorous computer-assisted application of {KAM} theory: a modern approach},
  journal = {Foundations of Computational Mathematics},
  volume = {17},
  pages = {1123--1193},
  year = {2017},
  doi = {10.1007/s10208-016-9339-3}
}
";

/// The BibTeX entry for Clenshaw's summation of Chebyshev series.
pub(super) const CLENSHAW: &str = "@article{Clenshaw1955,
  author = {Clenshaw, C. W.},
  title = {A note on the summation of {C}hebyshev series},
  journal = {Mathematics of Computation},
  volume = {9},
  pages = {118--120},
  year = {1955},
  doi = {10.1090/S0025-5718-1955-0071856-0}
}
";

/// The BibTeX entry for the Levenberg–Marquardt method of nonlinear least squares.
pub(super) const MARQUARDT: &str = "@article{Marquardt1963,
  author = {Marquardt, Donald W.},
  title = {An algorithm for least-squares estimation of nonlinear parameters},
  journal = {Journal of the Society for Industrial and Applied Mathematics},
  volume = {11},
  number = {2},
  pages = {431--441},
  year = {1963},
  doi = {10.1137/0111030}
}
";

/// The BibTeX entry for the optimiser Adam.
pub(super) const ADAM: &str = "@misc{KingmaBa2014,
  author = {Kingma, Diederik P. and Ba, Jimmy},
  title = {Adam: A method for stochastic optimization},
  year = {2014},
  eprint = {1412.6980},
  archivePrefix = {arXiv}
}
";

/// The BibTeX entry for the optimiser L-BFGS.
pub(super) const LBFGS: &str = "@article{LiuNocedal1989,
  author = {Liu, Dong C. and Nocedal, Jorge},
  title = {On the limited memory {BFGS} method for large scale optimization},
  journal = {Mathematical Programming},
  volume = {45},
  pages = {503--528},
  year = {1989},
  doi = {10.1007/BF01589116}
}
";

/// Gauss–Legendre collocation, the reference flow.
pub(super) const GAUSS_LEGENDRE: &str = "@book{HairerLubichWanner2006,
  author = {Hairer, Ernst and Lubich, Christian and Wanner, Gerhard},
  title = {Geometric Numerical Integration},
  edition = {2},
  publisher = {Springer},
  year = {2006},
  doi = {10.1007/3-540-30666-8}
}
";

/// The field lines, and maps of them by regression.
pub(super) const FIELD_LINES: &str = "@article{RathEtAl2021,
  author = {Rath, Katharina and Albert, Christopher G. and Bischl, Bernd and von Toussaint, Udo},
  title = {Symplectic {G}aussian process regression of maps in {H}amiltonian systems},
  journal = {Chaos},
  volume = {31},
  number = {5},
  pages = {053121},
  year = {2021},
  doi = {10.1063/5.0048129}
}
";

/// The BibTeX entry for tables of a step by cubic splines.
pub(super) const SPLINES: &str = "@book{deBoor2001,
  author = {de Boor, Carl},
  title = {A Practical Guide to Splines},
  edition = {revised},
  publisher = {Springer},
  year = {2001},
  isbn = {978-0-387-95366-3}
}
";

/// The BibTeX entry for symplectic maps from tables of generating functions.
pub(super) const GENERATING_FUNCTIONS: &str = "@article{Abdullaev1999,
  author = {Abdullaev, S. S.},
  title = {A new integration method of {H}amiltonian systems by symplectic maps},
  journal = {Journal of Physics A: Mathematical and General},
  volume = {32},
  pages = {2745--2766},
  year = {1999},
  doi = {10.1088/0305-4470/32/15/004}
}
";

/// The BibTeX entry for polynomial maps of beam physics.
pub(super) const MAP_METHODS: &str = "@book{Berz1999,
  author = {Berz, Martin},
  title = {Modern Map Methods in Particle Beam Physics},
  series = {Advances in Imaging and Electron Physics},
  volume = {108},
  publisher = {Academic Press},
  year = {1999}
}
";

/// Maps that are made symplectic by generating functions.
pub(super) const SYMPLECTIC_MAPS: &str = "@article{ErdelyiBerz2001,
  author = {Erd{\\'e}lyi, B{\\'e}la and Berz, Martin},
  title = {Optimal Symplectic Approximation of {H}amiltonian Flows},
  journal = {Physical Review Letters},
  volume = {87},
  pages = {114302},
  year = {2001},
  doi = {10.1103/PhysRevLett.87.114302}
}
";

/// Rotation numbers by weighted averages.
pub(super) const BIRKHOFF_AVERAGES: &str = "@article{DasSaikiSanderYorke2017,
  author = {Das, Suddhasattwa and Saiki, Yoshitaka and Sander, Evelyn and Yorke, James A.},
  title = {Quantitative quasiperiodicity},
  journal = {Nonlinearity},
  volume = {30},
  number = {11},
  pages = {4111--4140},
  year = {2017},
  doi = {10.1088/1361-6544/aa84c2}
}
";

/// Invariant curves as Fourier series.
pub(super) const INVARIANT_CURVES: &str = "@article{Jorba2001,
  author = {Jorba, {\\`A}ngel},
  title = {Numerical computation of the normal behaviour of invariant curves of n-dimensional maps},
  journal = {Nonlinearity},
  volume = {14},
  number = {5},
  pages = {943--976},
  year = {2001},
  doi = {10.1088/0951-7715/14/5/303}
}
";

/// The two BibTeX entries for frequency map analysis.
pub(super) const FREQUENCY_MAPS: &str = "@article{Laskar1990,
  author = {Laskar, Jacques},
  title = {The chaotic motion of the solar system: a numerical estimate of the size of the chaotic zones},
  journal = {Icarus},
  volume = {88},
  number = {2},
  pages = {266--291},
  year = {1990},
  doi = {10.1016/0019-1035(90)90084-M}
}
@article{Papaphilippou2014,
  author = {Papaphilippou, Yannis},
  title = {Detecting chaos in particle accelerators through the frequency map analysis method},
  journal = {Chaos},
  volume = {24},
  number = {2},
  pages = {024412},
  year = {2014},
  doi = {10.1063/1.4884495}
}
";

/// The dynamic aperture by the survival of orbits.
pub(super) const APERTURES: &str = "@article{TodescoGiovannozzi1996,
  author = {Todesco, E. and Giovannozzi, M.},
  title = {Dynamic aperture estimates and phase-space distortions in nonlinear betatron motion},
  journal = {Physical Review E},
  volume = {53},
  number = {4},
  pages = {4067--4076},
  year = {1996},
  doi = {10.1103/PhysRevE.53.4067}
}
";

/// The BibTeX entry for Greene's residues of periodic orbits.
pub(super) const RESIDUES: &str = "@article{Greene1979,
  author = {Greene, John M.},
  title = {A method for determining a stochastic transition},
  journal = {Journal of Mathematical Physics},
  volume = {20},
  number = {6},
  pages = {1183--1201},
  year = {1979},
  doi = {10.1063/1.524170}
}
";

/// The BibTeX entry for the computation of Lyapunov exponents.
pub(super) const EXPONENTS: &str = "@article{BenettinEtAl1980,
  author = {Benettin, Giancarlo and Galgani, Luigi and Giorgilli, Antonio and Strelcyn, Jean-Marie},
  title = {{L}yapunov characteristic exponents for smooth dynamical systems and for {H}amiltonian systems; a method for computing all of them. {P}art 1: Theory},
  journal = {Meccanica},
  volume = {15},
  pages = {9--20},
  year = {1980},
  doi = {10.1007/BF02128236}
}
";

/// The BibTeX entry for the smaller alignment index (SALI).
pub(super) const ALIGNMENT: &str = "@article{Skokos2001,
  author = {Skokos, Charalampos},
  title = {Alignment indices: a new, simple method for determining the ordered or chaotic nature of orbits},
  journal = {Journal of Physics A: Mathematical and General},
  volume = {34},
  number = {47},
  pages = {10029--10043},
  year = {2001},
  doi = {10.1088/0305-4470/34/47/309}
}
";

/// The BibTeX entry for stable and unstable manifolds of periodic orbits.
pub(super) const MANIFOLDS_OF_MAPS: &str = "@article{KrauskopfEtAl2005,
  author = {Krauskopf, Bernd and Osinga, Hinke M. and Doedel, Eusebius J. and Henderson, Michael E. and Guckenheimer, John and Vladimirsky, Alexander and Dellnitz, Michael and Junge, Oliver},
  title = {A survey of methods for computing (un)stable manifolds of vector fields},
  journal = {International Journal of Bifurcation and Chaos},
  volume = {15},
  number = {3},
  pages = {763--791},
  year = {2005},
  doi = {10.1142/S0218127405012533}
}
";
