//! The NPY format of numpy: one array of numbers.
//!
//! It is implemented here because the existing parsers read any Python literal, in a time
//! exponential in its depth, and need a C compiler. Source:
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.

use crate::error::Error;
use std::io::{Read, Write};

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// The longest header that is read; numpy writes 118 bytes for a matrix.
const LONGEST: usize = 4096;

/// Integers from here on are rounded by float64.
const MOST: f64 = (1_u64 << 53) as f64;

/// Bytes read at a time: whole numbers of any type.
const CHUNK: usize = 1 << 14;

/// An array read from a file, row by row whatever its memory order.
#[derive(Debug)]
pub struct Array {
    /// The sizes of the array, the slowest index first.
    pub shape: Vec<usize>,
    /// The numbers of the array, row by row.
    pub values: Vec<f64>,
    /// Whether the file held floating-point numbers of single precision.
    pub single: bool,
}

impl Array {
    /// Fails unless the array has two dimensions; returns (rows, columns).
    pub(super) fn matrix_shape(&self, place: &str) -> Result<(usize, usize), Error> {
        match self.shape[..] {
            [rows, columns] => Ok((rows, columns)),
            _ => Err(Error::content(
                place,
                "a two-dimensional array",
                format!("one of {} dimensions", self.shape.len()),
            )),
        }
    }
}

/// Appends the numbers that bytes stand for.
type Decode = fn(&[u8], &mut Vec<f64>);

/// The bytes of a number of a type that NumPy names so, and their reader.
fn numbers(descr: &str) -> Option<(usize, Decode)> {
    macro_rules! of {
        ($number:ty, $read:ident) => {
            (size_of::<$number>(), |bytes, values| {
                values.extend(bytes.as_chunks().0.iter().map(|b| <$number>::$read(*b) as f64));
            })
        };
    }
    Some(match descr {
        "<f8" => of!(f64, from_le_bytes),
        ">f8" => of!(f64, from_be_bytes),
        "<f4" => of!(f32, from_le_bytes),
        ">f4" => of!(f32, from_be_bytes),
        "|i1" => of!(i8, from_le_bytes),
        "<i2" => of!(i16, from_le_bytes),
        ">i2" => of!(i16, from_be_bytes),
        "<i4" => of!(i32, from_le_bytes),
        ">i4" => of!(i32, from_be_bytes),
        "<i8" => of!(i64, from_le_bytes),
        ">i8" => of!(i64, from_be_bytes),
        "|u1" => of!(u8, from_le_bytes),
        "<u2" => of!(u16, from_le_bytes),
        ">u2" => of!(u16, from_be_bytes),
        "<u4" => of!(u32, from_le_bytes),
        ">u4" => of!(u32, from_be_bytes),
        "<u8" => of!(u64, from_le_bytes),
        ">u8" => of!(u64, from_be_bytes),
        _ => return None,
    })
}

/// Reads an array of float64, float32 or integers below 2⁵³, of at most three dimensions, from a source of `size`
/// bytes; `place` names it in errors. What follows the array is left unread.
///
/// The memory used is that of the numbers which the source really holds, whatever its header says.
///
/// # Errors
/// When the source cannot be read, is no such array, or ends before its last number.
pub fn read_array(place: &str, source: &mut impl Read, size: u64) -> Result<Array, Error> {
    let malformed = |reason: String| Error::content(place, "an array in the NPY format", reason);
    let text = header_text(source).map_err(malformed)?;
    let header = Header::parse(&text).map_err(malformed)?;
    let Header { descr, fortran_order, shape } = header;
    let Some((each, decode)) = numbers(descr) else {
        return Err(Error::content(place, "float64 (or float32, or integer) numbers", descr));
    };
    if shape.len() > 3 {
        let found = format!("one of {}", shape.len());
        return Err(Error::content(place, "an array of at most three dimensions", found));
    }
    let all = shape.iter().try_fold(each, |n, d| n.checked_mul(*d));
    let Some(mut left) = all.filter(|all| *all as u64 <= size) else {
        return Err(malformed(format!("shape {shape:?}: more numbers than the file holds")));
    };
    let count = left / each;
    let mut values = Vec::with_capacity(count.min(CHUNK));
    let mut chunk = [0; CHUNK];
    let integers = !descr.contains('f');
    while left > 0 {
        let bytes = &mut chunk[..left.min(CHUNK)];
        let start = values.len();
        let read = fill(source, bytes).map_err(|reason| malformed(reason.to_string()))?;
        if read < bytes.len() {
            let found = start + read / each;
            return Err(malformed(format!("{found} of {count} numbers")));
        }
        decode(bytes, &mut values);
        let is_rounded = |value: &f64| integers && !(value.abs() < MOST);
        if let Some(k) = values[start..].iter().position(is_rounded) {
            let found = format!("the number {} is {:e}", start + k, values[start + k]);
            return Err(Error::content(
                place,
                "integers below 2⁵³, which float64 holds exactly",
                found,
            ));
        }
        left -= bytes.len();
    }
    if fortran_order {
        // The last index is the fastest here, the first is there.
        let there = |mut i: usize| {
            let (mut index, mut stride) = (0, count);
            for size in shape.iter().rev() {
                stride /= size;
                index += i % size * stride;
                i /= size;
            }
            index
        };
        values = (0..count).map(|i| values[there(i)]).collect();
    }
    Ok(Array { shape, values, single: each == 4 && !integers })
}

/// Fills as many bytes as there are.
fn fill(source: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<usize> {
    let mut done = 0;
    while done < bytes.len() {
        match source.read(&mut bytes[done..]) {
            Ok(0) => break,
            Ok(read) => done += read,
            Err(reason) if reason.kind() == std::io::ErrorKind::Interrupted => {}
            Err(reason) => return Err(reason),
        }
    }
    Ok(done)
}

/// Reads a text, which NumPy keeps as an array of no dimensions whose characters have four bytes each, from a source of
/// `size` bytes; `place` names it in errors.
pub(super) fn read_text(place: &str, source: &mut impl Read, size: u64) -> Result<String, Error> {
    let malformed = |reason: String| Error::content(place, "a text in the NPY format", reason);
    let header = header_text(source).map_err(malformed)?;
    let Header { descr, shape, .. } = Header::parse(&header).map_err(malformed)?;
    let length = descr.strip_prefix("<U").and_then(|length| length.parse::<usize>().ok());
    let bytes = length.filter(|_| shape.is_empty()).and_then(|length| length.checked_mul(4));
    let Some(bytes) = bytes.filter(|bytes| *bytes as u64 <= size) else {
        return Err(malformed(format!("numbers of type {descr} and shape {shape:?}")));
    };
    // As much as the source really holds, whatever its header says.
    let mut text = Vec::new();
    let read = source.take(bytes as u64).read_to_end(&mut text);
    read.map_err(|reason| malformed(reason.to_string()))?;
    if text.len() < bytes {
        return Err(malformed(format!("{} of {bytes} bytes", text.len())));
    }
    let characters = text.as_chunks().0.iter().map(|code| u32::from_le_bytes(*code));
    characters
        .map(|code| char::from_u32(code).ok_or_else(|| malformed(format!("the character {code}"))))
        .collect()
}

/// Writes a text as an array of no dimensions.
pub(super) fn write_text(out: &mut (impl Write + ?Sized), text: &str) -> std::io::Result<()> {
    write_header(out, &format!("<U{}", text.chars().count()), &[])?;
    text.chars().try_for_each(|c| out.write_all(&u32::from(c).to_le_bytes()))
}

/// Writes an array in the order of its rows.
///
/// # Errors
/// Those of `out`.
pub fn write_array(
    out: &mut (impl Write + ?Sized),
    shape: &[u64],
    values: &[f64],
) -> std::io::Result<()> {
    write_header(out, "<f8", shape)?;
    for values in values.chunks(CHUNK / 8) {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Writes the header of an array of numbers or characters of this type.
fn write_header(
    out: &mut (impl Write + ?Sized),
    descr: &str,
    shape: &[u64],
) -> std::io::Result<()> {
    let mut sizes: String = shape.iter().map(|size| format!("{size}, ")).collect();
    if shape.len() > 1 {
        sizes.truncate(sizes.len() - 2);
    }
    let sizes = sizes.trim_end();
    let dictionary =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // Numbers start at a multiple of 64 bytes, as readers that map a file want it.
    let start = (MAGIC.len() + 4 + dictionary.len() + 1).next_multiple_of(64);
    let length = start - MAGIC.len() - 4;
    let field = u16::try_from(length).expect("a few sizes are no long text");
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&field.to_le_bytes())?;
    writeln!(out, "{dictionary:<0$}", length - 1)
}

/// The text of the header, which the numbers follow.
fn header_text(source: &mut impl Read) -> Result<String, String> {
    let mut start = [0; 8];
    let read = |source: &mut dyn Read, bytes: &mut [u8], what: &str| {
        source.read_exact(bytes).map_err(|reason| format!("no {what}: {reason}"))
    };
    read(source, &mut start, "header")?;
    let version = start[6];
    if start[..6] != *MAGIC || !(1..=3).contains(&version) {
        return Err("no header of one".into());
    }
    // Version 1 has two bytes for the length, versions 2 and 3 have four.
    let mut length = [0; 4];
    read(source, &mut length[..if version == 1 { 2 } else { 4 }], "length of the header")?;
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST {
        return Err(format!("a header of {length} bytes"));
    }
    let mut text = vec![0; length];
    read(source, &mut text, "whole header")?;
    String::from_utf8(text).map_err(|reason| format!("a header that is no text: {reason}"))
}

/// What the header of a plain array says.
#[derive(Debug, PartialEq)]
struct Header<'a> {
    descr: &'a str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'a> Header<'a> {
    /// Reads a Python dictionary of the three keys, in any order, with nothing
    /// nested but the tuple of sizes:
    /// `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }`.
    fn parse(text: &'a str) -> Result<Self, String> {
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        let mut rest = Literal(text);
        rest.expect("{")?;
        while !rest.skip("}") {
            let key = rest.quoted()?;
            rest.expect(":")?;
            let again = match key {
                // A list of fields, of which there is no single number type.
                "descr" if rest.0.trim_start().starts_with('[') => {
                    return Err("records in place of numbers".into());
                }
                "descr" => descr.replace(rest.quoted()?).is_some(),
                "fortran_order" => fortran_order.replace(rest.truth()?).is_some(),
                "shape" => shape.replace(rest.sizes()?).is_some(),
                _ => return Err(format!("the key `{key}`")),
            };
            if again {
                return Err(format!("the key `{key}` twice"));
            }
            if !rest.skip(",") {
                rest.expect("}")?;
                break;
            }
        }
        if !rest.0.trim().is_empty() {
            return Err(rest.instead_of("the end of the header"));
        }
        let missing = |key: &str| format!("no key `{key}`");
        Ok(Self {
            descr: descr.ok_or_else(|| missing("descr"))?,
            fortran_order: fortran_order.ok_or_else(|| missing("fortran_order"))?,
            shape: shape.ok_or_else(|| missing("shape"))?,
        })
    }
}

/// The rest of a Python literal.
struct Literal<'a>(&'a str);

impl<'a> Literal<'a> {
    fn instead_of(&self, expected: &str) -> String {
        let start: String = self.0.chars().take(20).collect();
        format!("`{}` where {expected} should be", start.escape_debug())
    }

    fn skip(&mut self, token: &str) -> bool {
        self.0 = self.0.trim_start();
        let after = self.0.strip_prefix(token);
        self.0 = after.unwrap_or(self.0);
        after.is_some()
    }

    fn expect(&mut self, token: &str) -> Result<(), String> {
        if self.skip(token) { Ok(()) } else { Err(self.instead_of(&format!("`{token}`"))) }
    }

    fn quoted(&mut self) -> Result<&'a str, String> {
        for quote in ["'", "\""] {
            if self.skip(quote) {
                let end = self.0.split_once(quote);
                let (text, rest) = end.ok_or_else(|| self.instead_of("the end of a text"))?;
                self.0 = rest;
                return Ok(text);
            }
        }
        Err(self.instead_of("a text in quotes"))
    }

    fn truth(&mut self) -> Result<bool, String> {
        match (self.skip("True"), self.skip("False")) {
            (true, false) => Ok(true),
            (false, true) => Ok(false),
            _ => Err(self.instead_of("True or False")),
        }
    }

    fn sizes(&mut self) -> Result<Vec<usize>, String> {
        let mut sizes = Vec::new();
        self.expect("(")?;
        while !self.skip(")") {
            let digits =
                self.0.len() - self.0.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let (size, rest) = self.0.split_at(digits);
            sizes.push(size.parse().map_err(|_| self.instead_of("a size"))?);
            self.0 = rest;
            // Python 2 wrote 3L.
            self.skip("L");
            if !self.skip(",") {
                self.expect(")")?;
                break;
            }
        }
        Ok(sizes)
    }
}
