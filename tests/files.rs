//! Files: round trips, and every way in which they can be bad.
#![cfg(feature = "files")]

use gyroceptron::Error;
use gyroceptron::flow::{Pairs, Region};
use gyroceptron::io::internals::{crc32c, parse, read_array, write_array};
use gyroceptron::io::{
    Provenance, StoredModel, Tensor, assemble_weights, export_weights, import_weights,
    load_checkpoint, load_model, read_pairs, read_points, read_tensors, save_checkpoint,
    save_model, write_pairs, write_points,
};
use gyroceptron::layer::{Activation, CircleAction, TorusAction};
use gyroceptron::network::{
    CouplingGyroceptronShape, GyroceptronShape, HenonShape, InitialWeights, Model, NormalFormShape,
    Part, SympNetShape,
};
use gyroceptron::phase::Map;
use gyroceptron::train::{Control, TrainingOptions, train};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn model() -> Model {
    GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![3, 4],
        near_identity: vec![2],
    }
    .architecture(0.01)
    .initialise(InitialWeights::Glorot, 0.123_456_789_012_345_67, 5)
    .expect("valid")
}

/// An array in the NPY format, version 1.
fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(data);
    out
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn npz(path: &Path, entries: &[(&str, Vec<u8>)]) {
    npz_by(CompressionMethod::Stored, path, entries);
}

fn npz_by(method: CompressionMethod, path: &Path, entries: &[(&str, Vec<u8>)]) {
    let mut archive = ZipWriter::new(std::fs::File::create(path).expect("created"));
    for (name, bytes) in entries {
        let options = SimpleFileOptions::default().compression_method(method);
        archive.start_file(format!("{name}.npy"), options).expect("an entry");
        archive.write_all(bytes).expect("written");
    }
    archive.finish().expect("closed");
}

fn matrix(rows: usize, columns: usize) -> Vec<u8> {
    let values: Vec<f64> = (0..rows * columns).map(|i| i as f64 * 0.1).collect();
    npy("<f8", false, &format!("({rows}, {columns})"), &doubles(&values))
}

/// The one-line message of a refusal, which must name all these words.
fn names<T>(result: Result<T, Error>, words: &[&str]) {
    let Err(error) = result else { panic!("accepted what lacks {words:?}") };
    let text = error.to_string();
    assert_eq!(text.lines().count(), 1, "{text}");
    for word in words {
        assert!(text.contains(word), "`{text}` does not name `{word}`");
    }
}

fn symp_net(plain: bool) -> Model {
    let activation = Activation::Sigmoid;
    SympNetShape { dof: 2, modules: 3, shears: 2, activation, plain }
        .architecture()
        .initialise(InitialWeights::Glorot, 0.0, 1)
        .expect("valid")
}

fn couplings() -> Model {
    CouplingGyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![3, 4],
        near_identity: vec![2],
        flow_time: 2.0,
    }
    .architecture(0.01)
    .initialise(InitialWeights::Glorot, 0.4, 1)
    .expect("valid")
}

#[test]
fn models_keep_their_bits() {
    let folder = folder();
    let path = folder.path().join("model.json");
    for model in [
        model(),
        HenonShape::uniform(3, 2, 4)
            .architecture(1.0)
            .initialise(InitialWeights::Normal { scale: 1e-17 }, 0.0, 1)
            .expect("valid"),
        symp_net(false),
        symp_net(true),
        couplings(),
    ] {
        let provenance = Provenance { seed: Some(u64::MAX), ..Provenance::of_scene("test") };
        save_model(
            &path,
            &StoredModel { model: model.clone(), units: None, section: None, provenance },
        )
        .expect("written");
        let back = load_model(&path).expect("read");
        assert_eq!(back.model.architecture(), model.architecture());
        let bits = |m: &Model| {
            m.composition().parameters().iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(&back.model), bits(&model));
        assert_eq!(back.provenance.seed, Some(u64::MAX));
    }
}

/// A box of the wrong size, or without an inside, would be taken for the one of the pairs.
#[test]
fn boxes_that_are_none_are_refused() {
    let folder = folder();
    let path = folder.path().join("model.json");
    let dim = 2 * model().composition().dof();
    for (low, high, fits) in [
        (vec![-1.0; dim], vec![1.0; dim], true),
        (vec![], vec![], false),
        (vec![-1.0; dim], vec![1.0; dim - 1], false),
        (vec![1.0; dim], vec![-1.0; dim], false),
    ] {
        let region = Some(Region { low, high });
        let provenance = Provenance { region: region.clone(), ..Provenance::of_scene("test") };
        save_model(&path, &StoredModel { model: model(), units: None, section: None, provenance })
            .expect("written");
        let read = load_model(&path);
        assert_eq!(read.is_ok(), fits, "{region:?}");
        if let Ok(back) = read {
            assert_eq!(back.provenance.region, region);
        }
    }
}

#[test]
fn broken_models_are_refused() {
    let folder = folder();
    let path = folder.path().join("model.json");
    let stored = StoredModel {
        model: model(),
        units: None,
        section: None,
        provenance: Provenance::of_scene("test"),
    };
    save_model(&path, &stored).expect("written");
    let whole = std::fs::read_to_string(&path).expect("read");
    let with = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        std::fs::write(&path, whole.replacen(from, to, 1)).expect("written");
        load_model(&path)
    };
    names(with("\"version\": 3", "\"version\": 6"), &["model.json", "6", "5", "newer"]);
    names(with("gyroceptron-model", "gyroceptron-checkpoint"), &["model.json", "checkpoint"]);
    names(with("\"epsilon\": 0.01", "\"epsilon\": null"), &["model.json"]);
    names(with("\"epsilon\": 0.01", "\"epsilon\": 1e999"), &["model.json"]);
    names(
        with("\"parameters\": [", "\"parameters\": [0.5,"),
        &["parameters", "block 0", "43", "44"],
    );
    names(with("0.123456789", "0.123456788"), &["model.json", "digest"]);
    names(with("\"digest\"", "\"digets\""), &["model.json", "digets"]);
    // Counts that would wrap around.
    let wrap = "\"widths\": [\n          4611686018427387904,";
    names(with("\"widths\": [\n          3,", wrap), &["model.json", "parameters"]);
    for cut in [0, 1, 100, whole.len() / 2, whole.len() - 3] {
        std::fs::write(&path, &whole[..cut]).expect("written");
        names(load_model(&path), &["model.json"]);
    }
    std::fs::write(&path, [0xff, 0xfe, 0x00]).expect("written");
    names(load_model(&path), &["model.json"]);
    names(load_model(&folder.path().join("none.json")), &["none.json"]);
}

#[test]
fn checkpoints_notice_a_single_changed_digit() {
    let folder = folder();
    let path = folder.path().join("checkpoint");
    let input: Vec<f64> = (0..40).map(|i| libm::sin(f64::from(i))).collect();
    let pairs = Pairs::new("p", 2, input.clone(), input).expect("finite");
    let options = TrainingOptions { iterations: 3, checkpoint_every: 1, ..Default::default() };
    train(&model(), &pairs, None, &options, None, &mut |p| {
        if let Some(checkpoint) = p.checkpoint {
            save_checkpoint(&path, checkpoint)?;
        }
        Ok(Control::Continue)
    })
    .expect("runs");
    load_checkpoint(&path).expect("intact");
    let whole = std::fs::read(&path).expect("read");
    for at in (0..whole.len()).step_by(whole.len() / 97) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        std::fs::write(&path, &bytes).expect("written");
        names(load_checkpoint(&path), &["checkpoint"]);
    }
    std::fs::write(&path, &whole[..whole.len() - 1]).expect("written");
    names(load_checkpoint(&path), &["checkpoint"]);
}

#[test]
fn pairs_come_back_and_other_layouts_are_read() {
    let folder = folder();
    let path = folder.path().join("pairs.npz");
    let values: Vec<f64> = (0..12).map(|i| f64::from(i) * 0.1).collect();
    let pairs = Pairs::new("p", 2, values.clone(), values.clone()).expect("finite");
    write_pairs(&path, &pairs).expect("written");
    let back = read_pairs(&path).expect("read");
    assert_eq!((back.pairs, back.single_precision), (pairs.clone(), false));
    // The same numbers give the same bytes.
    let once = std::fs::read(&path).expect("read");
    write_pairs(&path, &pairs).expect("written");
    assert_eq!(once, std::fs::read(&path).expect("read"));

    let plain = npy("<f8", false, "(3, 4)", &doubles(&values));
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        npz_by(method, &path, &[("input", plain.clone()), ("output", plain.clone())]);
        assert_eq!(read_pairs(&path).expect("read").pairs, pairs);
    }

    let columns: Vec<f64> = (0..12).map(|i| values[(i % 3) * 4 + i / 3]).collect();
    let big: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    for bytes in [npy("<f8", true, "(3, 4)", &doubles(&columns)), npy(">f8", false, "(3, 4)", &big)]
    {
        npz(&path, &[("input", bytes.clone()), ("output", bytes)]);
        assert_eq!(read_pairs(&path).expect("read").pairs, pairs);
    }
    let single: Vec<u8> = values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    let single = npy("<f4", false, "(3, 4)", &single);
    npz(&path, &[("input", single.clone()), ("output", single), ("other", vec![1, 2])]);
    let read = read_pairs(&path).expect("read");
    assert!(read.single_precision);
    assert_eq!(read.pairs.input()[1], f64::from(0.1_f32));

    // Integers are numbers too: the last two below of each type are its extremes.
    let counts: Vec<i64> = vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 127, -128];
    let as_floats: Vec<f64> = counts.iter().map(|v| *v as f64).collect();
    let unsigned: Vec<u8> = vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 127, 255];
    let bytes_of = |bytes: fn(i64) -> Vec<u8>| counts.iter().flat_map(|v| bytes(*v)).collect();
    let of_types: [(&str, Vec<u8>); 7] = [
        ("|i1", bytes_of(|v| (v as i8).to_le_bytes().into())),
        ("<i2", bytes_of(|v| (v as i16).to_le_bytes().into())),
        (">i2", bytes_of(|v| (v as i16).to_be_bytes().into())),
        ("<i4", bytes_of(|v| (v as i32).to_le_bytes().into())),
        (">i4", bytes_of(|v| (v as i32).to_be_bytes().into())),
        ("<i8", bytes_of(|v| v.to_le_bytes().into())),
        (">i8", bytes_of(|v| v.to_be_bytes().into())),
    ];
    for (descr, bytes) in of_types {
        let array = npy(descr, false, "(3, 4)", &bytes);
        npz(&path, &[("input", array.clone()), ("output", array)]);
        let read = read_pairs(&path).expect(descr);
        assert_eq!((read.pairs.input(), read.single_precision), (&*as_floats, false), "{descr}");
    }
    let wide: fn(u8) -> [Vec<u8>; 4] = |v| {
        [
            vec![v],
            u16::from(v).to_le_bytes().into(),
            u32::from(v).to_be_bytes().into(),
            u64::from(v).to_le_bytes().into(),
        ]
    };
    for (k, descr) in ["|u1", "<u2", ">u4", "<u8"].into_iter().enumerate() {
        let bytes: Vec<u8> = unsigned.iter().flat_map(|v| wide(*v)[k].clone()).collect();
        let array = npy(descr, false, "(3, 4)", &bytes);
        npz(&path, &[("input", array.clone()), ("output", array)]);
        let read = read_pairs(&path).expect(descr);
        assert!(
            read.pairs.input().iter().eq(unsigned
                .iter()
                .map(|v| f64::from(*v))
                .collect::<Vec<_>>()
                .iter())
        );
    }
}

#[test]
fn broken_pairs_are_refused() {
    let folder = folder();
    let path = folder.path().join("pairs.npz");
    let check = |entries: &[(&str, Vec<u8>)], words: &[&str]| {
        npz(&path, entries);
        names(read_pairs(&path), words);
    };
    let good = matrix(3, 4);
    check(&[("input", good.clone())], &["pairs.npz: output", "input"]);
    check(&[("output", good.clone())], &["pairs.npz: input", "output"]);
    check(&[], &["pairs.npz: input", "none"]);
    check(
        &[("input", good.clone()), ("output", matrix(2, 4))],
        &["rows of output", "expected 3", "found 2"],
    );
    check(&[("input", good.clone()), ("output", matrix(3, 6))], &["4 columns", "6 columns"]);
    check(&[("input", matrix(3, 5)), ("output", matrix(3, 5))], &["even", "5 columns"]);
    check(&[("input", matrix(0, 4)), ("output", matrix(0, 4))], &["rows of input", "found 0"]);
    let bad = |value: f64| {
        let mut values = vec![0.5; 12];
        values[6] = value;
        npy("<f8", false, "(3, 4)", &doubles(&values))
    };
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let words = ["pairs.npz: output", "row 1", "column 2"];
        check(&[("input", good.clone()), ("output", bad(value))], &words);
    }
    let complex = npy("<c16", false, "(3, 4)", &[0; 192]);
    check(&[("input", complex), ("output", good.clone())], &["input", "float64", "c16"]);
    let truths = npy("|b1", false, "(3, 4)", &[0; 12]);
    check(&[("input", truths), ("output", good.clone())], &["input", "float64", "b1"]);
    // 2⁵³ − 1 is the largest integer that no other one is rounded to.
    for (value, is_exact) in [((1_i64 << 53) - 1, true), (1 << 53, false), (i64::MIN, false)] {
        let mut values = [0_i64; 12];
        values[6] = value;
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let integers = npy("<i8", false, "(3, 4)", &bytes);
        if is_exact {
            npz(&path, &[("input", integers), ("output", good.clone())]);
            assert_eq!(read_pairs(&path).expect("integers").pairs.input()[6], value as f64);
        } else {
            check(&[("input", integers), ("output", good.clone())], &["input", "2⁵³", "number 6"]);
        }
    }
    let line = npy("<f8", false, "(12,)", &[0; 96]);
    check(&[("input", line), ("output", good.clone())], &["two-dimensional"]);
    let cube = npy("<f8", false, "(3, 2, 2)", &[0; 96]);
    check(&[("input", cube), ("output", good.clone())], &["two-dimensional"]);
    let short = npy("<f8", false, "(3, 4)", &[0; 95]);
    check(&[("input", short), ("output", good.clone())], &["pairs.npz: input"]);
    let vast = npy("<f8", false, "(4000000000, 4)", &[0; 96]);
    check(&[("input", vast), ("output", good.clone())], &["pairs.npz: input"]);
    check(&[("input", b"no array".to_vec()), ("output", good.clone())], &["pairs.npz: input"]);

    npz(&path, &[("input", good.clone()), ("output", good)]);
    let whole = std::fs::read(&path).expect("read");
    for cut in [0, 10, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..cut]).expect("written");
        names(read_pairs(&path), &["pairs.npz"]);
    }
    // A flipped bit of a number: the archive's checksum sees it.
    let at = whole.windows(8).position(|w| w == 0.1_f64.to_le_bytes()).expect("a number");
    let mut flipped = whole;
    flipped[at + 5] ^= 4;
    std::fs::write(&path, flipped).expect("written");
    names(read_pairs(&path), &["pairs.npz: input"]);
    names(read_pairs(&folder.path().join("gone.npz")), &["gone.npz"]);
}

#[test]
fn points_come_back_and_bad_ones_are_refused() {
    let folder = folder();
    let path = folder.path().join("z.npy");
    write_points(&path, &[2, 4], &[0.5; 8]).expect("written");
    assert_eq!(read_points(&path, 2).expect("read").points, vec![0.5; 8]);
    names(read_points(&path, 3), &["z.npy", "6 columns", "4 columns"]);
    std::fs::write(&path, matrix(0, 4)).expect("written");
    names(read_points(&path, 2), &["z.npy", "zero rows"]);
    let nan = npy("<f8", false, "(1, 4)", &doubles(&[0.0, 1.0, f64::NAN, 0.0]));
    std::fs::write(&path, nan).expect("written");
    names(read_points(&path, 2), &["z.npy", "row 0", "column 2"]);
    std::fs::write(&path, &matrix(2, 4)[..100]).expect("written");
    names(read_points(&path, 2), &["z.npy"]);
    names(write_points(Path::new("/no/such/z.npy"), &[1], &[0.0]), &["/no/such/z.npy"]);
}

fn exported(ending: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = folder();
    let path = folder.path().join(format!("w.{ending}"));
    export_weights(&path, &model(), None).expect("written");
    (folder, path)
}

fn import(path: &Path) -> Result<Model, Error> {
    import_weights(path, &CircleAction::new([1, 0]).into(), 0.01, None)
}

#[test]
fn weights_come_back_from_both_formats() {
    for ending in ["safetensors", "npz"] {
        let (_folder, path) = exported(ending);
        let back = import(&path).expect("read");
        assert_eq!(back.composition().parameters(), model().composition().parameters());
        assert_eq!(back.architecture(), model().architecture());
        let tensors = read_tensors(&path).expect("read");
        assert_eq!(tensors.len(), 13);
        assert_eq!(tensors["psi.1.w_in"].shape, [2, 4]);
        assert_eq!(tensors["psi.0.b_in"].shape, [1, 3]);
        assert_eq!(tensors["near_identity.0.w_out"].shape, [2, 1]);
        assert_eq!(tensors["near_identity.0.eta"].shape, [1, 2]);
        assert_eq!(tensors["theta"].values, [0.123_456_789_012_345_67]);
    }
}

#[test]
fn broken_weights_are_refused() {
    let (_folder, path) = exported("npz");
    let tensors = read_tensors(&path).expect("read");
    type Change<'a> = &'a dyn Fn(&str, Vec<usize>, Vec<f64>) -> Option<(String, Vec<u8>)>;
    let write = |change: Change<'_>| {
        let entries: Vec<(String, Vec<u8>)> = tensors
            .iter()
            .filter_map(|(name, t)| change(name, t.shape.clone(), t.values.clone()))
            .collect();
        let entries: Vec<(&str, Vec<u8>)> =
            entries.iter().map(|(n, b)| (n.as_str(), b.clone())).collect();
        npz(&path, &entries);
    };
    let array = |shape: &[usize], values: &[f64]| {
        let shape: Vec<String> = shape.iter().map(|d| format!("{d},")).collect();
        npy("<f8", false, &format!("({})", shape.concat()), &doubles(values))
    };
    write(&|n, s, v| Some((n.into(), array(&s, &v))));
    import(&path).expect("unchanged");
    write(&|n, s, v| (n != "psi.1.eta").then(|| (n.into(), array(&s, &v))));
    names(import(&path), &["psi.1.eta", "none"]);
    write(&|n, s, v| (n != "theta").then(|| (n.into(), array(&s, &v))));
    names(import(&path), &["theta", "none"]);
    write(&|n, s, v| Some((n.replace("psi.1.eta", "psi.1.etta"), array(&s, &v))));
    names(import(&path), &["psi.1.eta"]);
    write(&|n, s, v| {
        let s = if n == "psi.0.w_out" { vec![1, 3] } else { s };
        Some((n.into(), array(&s, &v)))
    });
    names(import(&path), &["psi.0.w_out", "[3, 1]", "[1, 3]"]);
    write(&|n, s, v| {
        let v = if n == "psi.1.w_in" { [&v[..6], &[f64::NAN], &v[7..]].concat() } else { v };
        Some((n.into(), array(&s, &v)))
    });
    names(import(&path), &["psi.1.w_in", "row 1", "column 2"]);
    write(&|n, s, v| Some((n.into(), array(&s, &v))));
    names(import_weights(&path, &CircleAction::new([1, 0, 2]).into(), 0.01, None), &["w_in", "3"]);
    names(
        import_weights(&path, &CircleAction::new([1, 0]).into(), f64::NAN, None),
        &["epsilon", "NaN"],
    );

    // One tensor too many, in the other format.
    let (_folder, path) = exported("safetensors");
    let whole = std::fs::read(&path).expect("read");
    for cut in [0, 7, 50, whole.len() - 1] {
        std::fs::write(&path, &whole[..cut]).expect("written");
        names(import(&path), &["w.safetensors"]);
    }
    let text = String::from_utf8_lossy(&whole).into_owned();
    assert!(text.contains("near_identity.0.eta"));
    let renamed: Vec<u8> = replace(&whole, b"near_identity.0.eta", b"near_identity.0.etb");
    std::fs::write(&path, renamed).expect("written");
    names(import(&path), &["near_identity.0.eta"]);
    let halves = replace(&whole, b"\"dtype\":\"F64\"", b"\"dtype\":\"I64\"");
    std::fs::write(&path, halves).expect("written");
    names(import(&path), &["float"]);
    names(import(&folder().path().join("w.txt")), &["w.txt"]);
    let other = path.with_extension("bin");
    std::fs::write(&other, whole).expect("written");
    names(import(&other), &["w.bin", ".safetensors or .npz"]);
}

fn replace(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|w| w == from).expect("present");
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

#[test]
fn superfluous_tensors_are_named() {
    let (_folder, path) = exported("npz");
    let mut entries: Vec<(String, Vec<u8>)> = read_tensors(&path)
        .expect("read")
        .into_iter()
        .map(|(name, t)| {
            let shape: Vec<String> = t.shape.iter().map(|d| format!("{d},")).collect();
            (name, npy("<f8", false, &format!("({})", shape.concat()), &doubles(&t.values)))
        })
        .collect();
    entries.push(("psi.7.eta".into(), npy("<f8", false, "(1, 2)", &[0; 16])));
    let entries: Vec<(&str, Vec<u8>)> =
        entries.iter().map(|(n, b)| (n.as_str(), b.clone())).collect();
    npz(&path, &entries);
    names(import(&path), &["psi.7.eta", "superfluous"]);
}

#[test]
fn nothing_is_left_of_a_file_that_could_not_be_written() {
    let folder = folder();
    let path = folder.path().join("out");
    let result = gyroceptron::io::write_atomically(&path, |out| {
        out.write_all(b"half")?;
        Err(std::io::Error::other("the disk went away"))
    });
    names(result, &["out", "the disk went away"]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    std::fs::write(&path, "old").expect("written");
    let _ = gyroceptron::io::write_atomically(&path, |_| Err(std::io::Error::other("no")));
    assert_eq!(std::fs::read_to_string(&path).expect("still there"), "old");
}

/// A TensorFlow checkpoint as the authors' code writes it: psi of eleven layers, the
/// tenth after the ninth and not after the first; the numbers that its maker gave it.
#[test]
fn tensorflow_checkpoints_are_read() {
    let index = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/checkpoint/small.ckpt.index");
    let action = TorusAction::from(CircleAction::new([1, 0]));
    let model = import_weights(&index, &action, 0.01, None).expect("a model");
    let widths = |part| model.architecture().widths(part);
    assert_eq!(widths(Part::Conjugation), vec![3; 11]);
    assert_eq!(widths(Part::NearIdentity), vec![2]);
    // Each layer was filled as W, w, b, η; the parameters are W, b, w, η.
    let mut expected = Vec::new();
    let mut next = 0;
    for width in [3; 11].into_iter().chain([2]) {
        let mut fill = |count: usize| {
            let numbers = (next..next + count).map(|k| ((k % 61) as f64 - 30.0) / 64.0);
            next += count;
            numbers.collect::<Vec<f64>>()
        };
        let (w_in, w_out, b_in, eta) = (fill(2 * width), fill(width), fill(width), fill(2));
        expected.extend([w_in, b_in, w_out, eta].concat());
    }
    expected.push(0.625);
    assert_eq!(model.composition().parameters(), expected);
    let folder = folder();
    let alone = folder.path().join("small.ckpt.index");
    std::fs::copy(&index, &alone).expect("copied");
    names(import_weights(&alone, &action, 0.01, None), &["small.ckpt.data-00000-of-00001"]);
}

/// Tensors of turned twists alone are recognised as those of a normal form.
#[test]
fn turned_twists_alone_come_back() {
    let shape = NormalFormShape {
        action: CircleAction::new([1, 0]).into(),
        psi: vec![],
        kicks: vec![],
        twists: vec![],
        turned_twists: vec![3, 2],
        flow_time: 2.0,
        perturbation: None,
    };
    let architecture = shape.architecture(0.02);
    let model = architecture.initialise(InitialWeights::Glorot, 0.3, 5).expect("a model");
    let (folder, action) = (folder(), shape.action.clone());
    let path = folder.path().join("w.npz");
    export_weights(&path, &model, None).expect("written");
    let tensors = read_tensors(&path).expect("read");
    assert!(tensors.keys().all(|name| name.starts_with("turned_twist.") || name == "theta"));
    let back = assemble_weights("w", tensors, &action, 0.02, Some(2.0)).expect("read");
    // A block without layers is none that a file of tensors tells of.
    assert_eq!(back.parameters(), model.parameters());
    assert_eq!(back.architecture().twist_shears(), 2);
    let (mut one, mut other) = ([0.3, -0.2, 0.5, 0.7], [0.3, -0.2, 0.5, 0.7]);
    model.forward(&mut one);
    back.forward(&mut other);
    assert_eq!(one, other);
}

fn normal_form() -> Model {
    let circles = [CircleAction::new([0, 1, 0]), CircleAction::new([0, 0, 2])];
    let shape = NormalFormShape {
        action: TorusAction::new(circles).expect("two circles"),
        psi: vec![2],
        kicks: vec![3, 1],
        twists: vec![4, 2, 0],
        turned_twists: vec![3, 1],
        flow_time: 7.5,
        perturbation: None,
    };
    let architecture = shape.architecture(0.02);
    let model = architecture.initialise(InitialWeights::Glorot, 0.3, 5).expect("a model");
    model.with_angles(&[0.25, -1.5]).expect("two angles")
}

#[test]
fn a_normal_form_comes_back() {
    let (folder, model) = (folder(), normal_form());
    let file = folder.path().join("m.json");
    let stored = StoredModel {
        model: model.clone(),
        units: None,
        section: None,
        provenance: Provenance::of_scene("test"),
    };
    save_model(&file, &stored).expect("written");
    let back = load_model(&file).expect("read").model;
    assert_eq!(back.architecture(), model.architecture());
    assert_eq!(back.composition().parameters(), model.composition().parameters());
    assert_eq!(back.angles(), [0.25, -1.5]);
    assert_eq!(back.angle(), None);
    for ending in ["safetensors", "npz"] {
        let path = folder.path().join(format!("w.{ending}"));
        export_weights(&path, &model, None).expect("written");
        let tensors = read_tensors(&path).expect("read");
        assert_eq!(tensors["kick.0.angles"].shape, [1, 3]);
        assert_eq!(tensors["kick.1.w_in"].shape, [3, 1]);
        assert_eq!(tensors["twist.1.w_in"].shape, [3, 2]);
        assert_eq!(tensors["twist.0.quadratic"].shape, [1, 6]);
        assert!(!tensors.contains_key("twist.1.quadratic"));
        assert_eq!(tensors["twist.2.w_in"].shape, [3, 0]);
        assert_eq!(tensors["twist.2.quadratic"].shape, [1, 6]);
        assert_eq!(tensors["turned_twist.0.angles"].shape, [1, 1]);
        assert_eq!(tensors["turned_twist.1.w_in"].shape, [3, 1]);
        assert!(!tensors.contains_key("turned_twist.0.quadratic"));
        assert_eq!(tensors["theta"].values, [0.25, -1.5]);
        // In the order of the parameters.
        let offset = 3 * 2 + 2 + 2 + 3;
        assert_eq!(
            tensors["kick.0.angles"].values,
            model.composition().parameters()[offset..][..3]
        );
        let action = model.architecture().action().expect("two circles");
        let read = |tensors| assemble_weights("w", tensors, &action, 0.02, Some(7.5));
        let back = read(tensors.clone()).expect("read");
        assert_eq!(back.architecture(), model.architecture());
        assert_eq!(back.composition().parameters(), model.composition().parameters());
        for lacking in [
            "kick.0.w_in",
            "kick.1.b_in",
            "twist.1.w_in",
            "twist.0.quadratic",
            "turned_twist.1.angles",
            "theta",
        ] {
            let mut tensors = tensors.clone();
            tensors.remove(lacking);
            names(read(tensors), &[lacking]);
        }
        let mut wrong = tensors.clone();
        let low =
            Tensor { shape: vec![2, 2], values: vec![0.0; 4], ..wrong["twist.1.w_in"].clone() };
        wrong.insert("twist.1.w_in".into(), low);
        names(read(wrong), &["twist.1.w_in", "(3, h)", "[2, 2]"]);
        let mut wrong = tensors.clone();
        let wide =
            Tensor { shape: vec![1, 4], values: vec![0.0; 4], ..wrong["twist.1.b_in"].clone() };
        wrong.insert("twist.1.b_in".into(), wide);
        names(read(wrong), &["twist.1.b_in", "[1, 2]", "[1, 4]"]);
        let mut one_angle = tensors.clone();
        let theta = Tensor { shape: vec![1], values: vec![0.0], ..one_angle["theta"].clone() };
        one_angle.insert("theta".into(), theta);
        names(read(one_angle), &["theta", "2 elements"]);
    }
    names(model.with_angles(&[1.0]), &["angles", "2", "1"]);
}

/// One with a perturbation, and one of order one without kicks of it.
#[test]
fn a_perturbed_normal_form_comes_back() {
    for kicks in [vec![2, 1], Vec::new()] {
        let action: TorusAction = CircleAction::new([1, 0]).into();
        let shape = NormalFormShape {
            action: action.clone(),
            psi: vec![2],
            kicks: vec![3],
            twists: vec![4],
            turned_twists: vec![],
            flow_time: 7.5,
            perturbation: Some(kicks.clone()),
        };
        let architecture = shape.architecture(0.02);
        let model = architecture.initialise(InitialWeights::Glorot, 0.3, 5).expect("a model");
        for ending in ["safetensors", "npz"] {
            let folder = folder();
            let path = folder.path().join(format!("w.{ending}"));
            export_weights(&path, &model, None).expect("written");
            let tensors = read_tensors(&path).expect("read");
            let read = |tensors| assemble_weights("w", tensors, &action, 0.02, Some(7.5));
            let back = read(tensors.clone()).expect("read");
            assert_eq!(back.architecture(), model.architecture());
            assert_eq!(back.composition().parameters(), model.composition().parameters());
            let mut wrong = tensors.clone();
            let count =
                Tensor { shape: vec![1], values: vec![3.0], ..wrong["perturbation"].clone() };
            wrong.insert("perturbation".into(), count);
            names(read(wrong), &["w: perturbation", &format!("[{}]", kicks.len()), "[3.0]"]);
            if kicks.is_empty() {
                continue;
            }
            let mut lacking = tensors.clone();
            lacking.remove("perturbation");
            names(read(lacking), &["w: perturbation", "none"]);
            let mut lacking = tensors;
            lacking.remove("perturbation.1.angles");
            names(read(lacking), &["perturbation.1.angles"]);
        }
    }
}

#[test]
fn pairs_of_a_family_come_back() {
    let folder = folder();
    let path = folder.path().join("pairs.npz");
    let set = |base: f64, count: usize| {
        let values: Vec<f64> = (0..2 * count).map(|k| base + k as f64).collect();
        Pairs::new("set", 1, values.clone(), values).expect("pairs")
    };
    let family = vec![(0.1, 5.0, set(0.0, 2)), (0.1, 7.0, set(10.0, 1)), (0.2, 5.0, set(20.0, 3))];
    let family = Pairs::of_family(family).expect("sets");
    write_pairs(&path, &family).expect("written");
    let file = read_pairs(&path).expect("read");
    assert_eq!(file.pairs, family);
    assert!(file.has_epsilons && file.has_times);
    // Rows in any order, and one of the two arrays.
    let column =
        |values: &[f64]| npy("<f8", false, &format!("({},)", values.len()), &doubles(values));
    let rows = npy("<f8", false, "(3, 2)", &doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let of = |more: &[(&str, Vec<u8>)]| {
        let mut entries = vec![("input", rows.clone()), ("output", rows.clone())];
        entries.extend_from_slice(more);
        npz(&path, &entries);
        read_pairs(&path)
    };
    let file = of(&[("epsilon", column(&[0.2, 0.1, 0.2]))]).expect("read");
    assert_eq!(file.pairs.input(), [1.0, 2.0, 5.0, 6.0, 3.0, 4.0]);
    assert_eq!((file.has_epsilons, file.has_times), (true, false));
    let conditions: Vec<_> =
        file.pairs.conditions().iter().map(|c| (c.epsilon, c.time, c.pairs)).collect();
    assert_eq!(conditions, [(0.2, 1.0, 2), (0.1, 1.0, 1)]);
    names(of(&[("epsilon", column(&[0.2, 0.1]))]), &["epsilon", "3", "2"]);
    // Another flow time by mistake trains one map on pairs of several: the program says so.
    let slip = of(&[("epsilons", column(&[0.2, 0.1, 0.2]))]).expect("read");
    assert_eq!((slip.unused, slip.has_epsilons), (vec!["epsilons".to_owned()], false));
    assert!(slip.pairs.conditions().is_empty());
    names(of(&[("epsilon", column(&[0.2, f64::NAN, 0.1]))]), &["epsilon", "NaN"]);
    names(of(&[("flow_time", column(&[0.2, 0.0, 0.1]))]), &["flow_time", "0"]);
}

const INDEX: &[u8] = include_bytes!("checkpoint/small.ckpt.index");
const NUMBERS: &[u8] = include_bytes!("checkpoint/small.ckpt.data-00000-of-00001");

fn read_bundle(index: &[u8], data: &[u8]) -> Result<BTreeMap<String, Tensor>, Error> {
    parse("index", index, "data", data)
}

#[test]
fn the_checksum_is_the_known_one() {
    assert_eq!(crc32c(b"123456789"), 0xe306_9283);
}

/// Whatever is cut off or changed is an error or other numbers, and no panic; a
/// changed number is an error.
#[test]
fn broken_checkpoints_are_refused() {
    let whole = read_bundle(INDEX, NUMBERS).expect("sound");
    assert_eq!(whole.len(), 12 * 4 + 1);
    for cut in 0..INDEX.len() {
        assert!(read_bundle(&INDEX[..cut], NUMBERS).is_err(), "{cut}");
    }
    for place in 0..INDEX.len() {
        for flip in [1, 0x80, 0xff] {
            let mut index = INDEX.to_vec();
            index[place] ^= flip;
            let _ = read_bundle(&index, NUMBERS);
        }
    }
    let used: usize = whole.values().map(|t| 4 * t.values.len()).sum();
    for place in 0..used {
        let mut data = NUMBERS.to_vec();
        // Strings may stand between the numbers.
        data[place] ^= 0x10;
        if let Ok(read) = read_bundle(INDEX, &data) {
            assert_eq!(read, whole, "{place}");
        }
    }
    assert!(read_bundle(INDEX, &NUMBERS[..100]).is_err());
    assert!(read_bundle(b"", b"").is_err());
}

/// An array of zeros in the NPY format, with this text as its header.
fn with_header(text: &str, numbers: usize) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(text.len()).expect("a short text").to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.resize(bytes.len() + numbers, 0);
    bytes
}

#[test]
fn headers_of_plain_arrays_are_read_and_no_others() {
    let read = |text: &str| {
        let bytes = with_header(text, 8 * 12);
        let array = read_array("z", &mut &bytes[..], bytes.len() as u64).ok()?;
        Some((array.single, array.shape))
    };
    let double = |shape: &[usize]| Some((false, shape.to_vec()));
    for (text, expected) in [
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }   \n", double(&[3, 4])),
        ("{\"shape\":(12,),'fortran_order':False,'descr':'>f4'}", Some((true, vec![12]))),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': ()}", double(&[])),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3L, 4L)}", double(&[3, 4])),
        ("", None),
        ("{}", None),
        ("{'descr': '<f8', 'fortran_order': False}", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), 'x': 1}", None),
        ("{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': (3,)}", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4)} 1", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-3, 4)}", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3 4)}", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4", None),
        ("{'descr': '<f8', 'fortran_order': 0, 'shape': (3, 4)}", None),
        ("{'descr': '<f8, 'fortran_order': False, 'shape': (3, 4)}", None),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999,)}", None),
        ("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,)}", None),
    ] {
        assert_eq!(read(text), expected, "{text}");
    }
    // What takes a parser of all literals exponential time is refused at once.
    assert_eq!(read(&format!("{{'descr': {}", "[(".repeat(1000))), None);
    assert_eq!(read(&"(".repeat(4096)), None);
}

#[test]
fn sizes_beyond_the_file_are_refused_before_memory_is_asked_for() {
    let mut bytes = Vec::new();
    write_array(&mut bytes, &[3, 2], &[0.5; 6]).expect("written");
    let numbers = bytes.len() - 48;
    assert_eq!(numbers % 64, 0);
    let read = |bytes: &[u8], size: usize| read_array("z", &mut &bytes[..], size as u64);
    assert_eq!(read(&bytes, bytes.len()).expect("read").values, [0.5; 6]);
    let text = String::from_utf8_lossy(&bytes[10..numbers]).into_owned();
    for shape in ["(3, 3)", "(4000000000, 4000000000)", "(18446744073709551615, 1)"] {
        let changed = text.replacen("(3, 2)", shape, 1);
        let mut vast = bytes[..8].to_vec();
        vast.extend((changed.len() as u16).to_le_bytes());
        vast.extend(changed.as_bytes());
        vast.extend(&bytes[numbers..]);
        assert!(read(&vast, vast.len()).is_err(), "{shape}");
        // A source that holds less than it says.
        assert!(read(&vast, usize::MAX).is_err(), "{shape}");
    }
    for cut in 0..bytes.len() {
        assert!(read(&bytes[..cut], bytes.len()).is_err(), "cut at {cut}");
    }
}
