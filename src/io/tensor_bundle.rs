//! TensorFlow checkpoints: the file `NAME.index`, a table of keys, and
//! `NAME.data-00000-of-00001` beside it, the numbers.
//!
//! The index is a table of the LevelDB format without compression; its values are protocol buffers
//! (`tensorflow/core/protobuf/tensor_bundle.proto`). The checkpoints that are read are those of the
//! code published with Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>:
//! names such as `psi_layers/{i}/W_in` become `psi.{i}.w_in`.

use super::read_bytes;
use super::tensor::Tensor;
use crate::error::Error;
use std::collections::BTreeMap;
use std::path::Path;

const ENDING: &str = ".index";
const DATA: &str = ".data-00000-of-00001";

/// The last bytes of a table: two handles of blocks, padded, and a number that says what
/// it is.
const FOOTER: usize = 48;
const MAGIC: [u8; 8] = 0xdb47_7524_8b80_fb57_u64.to_le_bytes();
/// What ends the name of a variable.
const VARIABLE: &str = "/.ATTRIBUTES/VARIABLE_VALUE";

/// Whether a file name is that of an index.
pub(super) fn is_index(path: &Path) -> bool {
    path.to_str().is_some_and(|name| name.ends_with(ENDING))
}

/// The tensors of a checkpoint, under the names of this crate.
///
/// # Errors
/// When a file is missing or corrupt, or a tensor is not float32 or float64.
pub(super) fn read(index: &Path) -> Result<BTreeMap<String, Tensor>, Error> {
    let place = index.display().to_string();
    let name = place.strip_suffix(ENDING).unwrap_or(&place);
    let data = format!("{name}{DATA}");
    parse(&place, &read_bytes(index)?, &data, &read_bytes(Path::new(&data))?)
}

/// Reads the tensors in the bytes of both files; their places name them in errors.
///
/// # Errors
/// When they are corrupt, or a tensor is not float32 or float64.
pub fn parse(
    place: &str,
    index: &[u8],
    data_place: &str,
    data: &[u8],
) -> Result<BTreeMap<String, Tensor>, Error> {
    let corrupt = || Error::content(place, "the index of a TensorFlow checkpoint", "another file");
    let mut tensors = BTreeMap::new();
    for (key, value) in entries(index).ok_or_else(corrupt)? {
        let Some(name) = std::str::from_utf8(&key).ok().and_then(|key| key.strip_suffix(VARIABLE))
        else {
            continue;
        };
        let entry = Entry::of(&value).ok_or_else(corrupt)?;
        let tensor = entry.tensor(&format!("{data_place}: {name}"), data)?;
        tensors.insert(renamed(name), tensor);
    }
    Ok(tensors)
}

/// The name of a tensor in this crate, such as `psi.0.w_in` for `psi_layers/0/W_in`.
fn renamed(name: &str) -> String {
    let parts: Vec<&str> = name.split('/').collect();
    match parts[..] {
        ["psi_layers", layer, tensor] => format!("psi.{layer}.{}", tensor.to_lowercase()),
        ["NI_layers", layer, tensor] => {
            format!("near_identity.{layer}.{}", tensor.to_lowercase())
        }
        [.., "theta0"] => "theta".into(),
        _ => name.into(),
    }
}

/// The first bytes of a slice, which goes on behind them.
fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (head, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(head)
}

/// An integer of seven bits a byte, the lowest first.
fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = take(bytes, 1)?[0];
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

fn length(bytes: &mut &[u8]) -> Option<usize> {
    usize::try_from(varint(bytes)?).ok()
}

/// The keys of a table, each with its value, as bytes.
type Entries = Vec<(Vec<u8>, Vec<u8>)>;

/// The keys and values of a table.
fn entries(table: &[u8]) -> Option<Entries> {
    let footer = table.len().checked_sub(FOOTER)?;
    if !table.ends_with(&MAGIC) {
        return None;
    }
    let mut handles = &table[footer..];
    // That of what describes the table, which is not needed.
    let _ = (varint(&mut handles)?, varint(&mut handles)?);
    let mut out = Vec::new();
    for (_, mut handle) in block(table, &mut handles)? {
        let mut handle = &std::mem::take(&mut handle)[..];
        out.extend(block(table, &mut handle)?);
    }
    Some(out)
}

/// The keys and values of the block at a handle, its offset and size. Each key repeats
/// the beginning of the one before.
fn block(table: &[u8], handle: &mut &[u8]) -> Option<Entries> {
    let (offset, size) = (length(handle)?, length(handle)?);
    let block = table.get(offset..offset.checked_add(size)?)?;
    let uncompressed = *table.get(offset + size)? == 0;
    let restarts = block.len().checked_sub(4)?;
    let count = u32::from_le_bytes(block[restarts..].try_into().ok()?) as usize;
    let end = restarts.checked_sub(count.checked_mul(4)?)?;
    if !uncompressed {
        return None;
    }
    let mut bytes = &block[..end];
    let mut out = Entries::new();
    let mut key = Vec::new();
    while !bytes.is_empty() {
        let (shared, unshared) = (length(&mut bytes)?, length(&mut bytes)?);
        let size = length(&mut bytes)?;
        if shared > key.len() {
            return None;
        }
        key.truncate(shared);
        key.extend_from_slice(take(&mut bytes, unshared)?);
        out.push((key.clone(), take(&mut bytes, size)?.to_vec()));
    }
    Some(out)
}

/// The entry of a tensor in the index: its number type, shape, place and checksum.
#[derive(Default)]
struct Entry {
    /// 1 for float32, 2 for float64.
    kind: u64,
    shape: Vec<usize>,
    offset: usize,
    size: usize,
    /// Of its bytes: CRC-32C, rotated and shifted.
    checksum: u32,
}

/// The fields of a protocol buffer: number, value, bytes.
fn fields(mut bytes: &[u8]) -> Option<Vec<(u64, u64, &[u8])>> {
    let mut out = Vec::new();
    while !bytes.is_empty() {
        let tag = varint(&mut bytes)?;
        let (value, inside) = match tag & 7 {
            0 => (varint(&mut bytes)?, &[][..]),
            1 => (0, take(&mut bytes, 8)?),
            2 => {
                let size = length(&mut bytes)?;
                (0, take(&mut bytes, size)?)
            }
            5 => {
                let value = take(&mut bytes, 4)?;
                (u64::from(u32::from_le_bytes(value.try_into().ok()?)), value)
            }
            _ => return None,
        };
        out.push((tag >> 3, value, inside));
    }
    Some(out)
}

impl Entry {
    fn of(bytes: &[u8]) -> Option<Self> {
        let mut out = Self::default();
        for (field, value, inside) in fields(bytes)? {
            match field {
                1 => out.kind = value,
                2 => {
                    for (_, _, dimension) in fields(inside)?.into_iter().filter(|f| f.0 == 2) {
                        let size = fields(dimension)?.into_iter().find(|f| f.0 == 1);
                        out.shape.push(usize::try_from(size.map_or(0, |f| f.1)).ok()?);
                    }
                }
                4 => out.offset = usize::try_from(value).ok()?,
                5 => out.size = usize::try_from(value).ok()?,
                6 => out.checksum = u32::try_from(value).ok()?,
                _ => {}
            }
        }
        Some(out)
    }

    fn tensor(self, place: &str, data: &[u8]) -> Result<Tensor, Error> {
        let end = self.offset.checked_add(self.size);
        let Some(bytes) = end.and_then(|end| data.get(self.offset..end)) else {
            let (expected, found) = ("as many bytes as the index says", data.len());
            return Err(Error::content(place, expected, found));
        };
        if masked(crc32c(bytes)) != self.checksum {
            return Err(Error::content(place, "its checksum", "another"));
        }
        let values: Vec<f64> = match self.kind {
            1 => {
                let numbers = bytes.as_chunks::<4>().0.iter();
                numbers.map(|b| f64::from(f32::from_le_bytes(*b))).collect()
            }
            2 => bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            other => {
                let found = format!("number type {other}");
                return Err(Error::content(place, "float32 or float64", found));
            }
        };
        let count = self.shape.iter().try_fold(1_usize, |n, d| n.checked_mul(*d));
        if count != Some(values.len()) {
            let expected = format!("numbers for the shape {:?}", self.shape);
            return Err(Error::content(place, expected, values.len()));
        }
        Ok(Tensor { shape: self.shape, values, single_precision: self.kind == 1 })
    }
}

/// The checksum of Castagnoli, bit by bit.
pub fn crc32c(bytes: &[u8]) -> u32 {
    const POLYNOMIAL: u32 = 0x82f6_3b78;
    let mut crc = !0_u32;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (POLYNOMIAL & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

fn masked(crc: u32) -> u32 {
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}
