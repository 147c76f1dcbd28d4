//! Telemetry logs of ground stations (`.tlog`): MAVLink frames, each after a stamp.
//!
//! Reference: MAVLink, *Packet Serialization*; a stamp is eight bytes, µs, the highest first.

use std::collections::{BTreeMap, HashMap};

use crate::error::LogError;

const STAMP: usize = 8;
const V1: (u8, usize) = (0xFE, 6);
const V2: (u8, usize) = (0xFD, 10);
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
const SIGNED: u8 = 1;

/// What is known of a message: bytes of its payload with all extensions, and its seed.
pub type Known = HashMap<u32, (usize, u8)>;

/// Frames of one message from one sender.
#[derive(Debug, Clone, Default)]
pub struct Frames {
    /// Stamps of the ground station, µs.
    pub stamps_us: Vec<u64>,
    /// Payloads one after the other, each padded with zeros to its whole width.
    pub payloads: Vec<u8>,
}

/// All frames by message, system and component, and what was not read.
#[derive(Debug, Clone, Default)]
pub struct Telemetry {
    /// Frames by message, system and component.
    pub frames: BTreeMap<(u32, u8, u8), Frames>,
    /// Bytes that are in no frame.
    pub lost: usize,
    /// Bytes that the frames take, those of their copies for Python too.
    held: usize,
}

struct Frame<'a> {
    message: u32,
    system: u8,
    component: u8,
    payload: &'a [u8],
    checked: &'a [u8],
    checksum: u16,
    size: usize,
}

/// Whether the bytes begin as a telemetry log does: two whole frames, each after a stamp.
pub fn is_telemetry(bytes: &[u8]) -> bool {
    let next = |at: usize| frame(bytes.get(at + STAMP..)?).map(|found| at + STAMP + found.size);
    next(0).is_some_and(|second| second == bytes.len() || next(second).is_some())
}

/// Read all frames of the messages that are known.
///
/// # Errors
/// Bytes and frames take more than `budget` bytes: a frame of few bytes may stand for many.
pub fn read(bytes: &[u8], known: &Known, budget: usize) -> Result<Telemetry, LogError> {
    let mut log = Telemetry { held: bytes.len(), ..Telemetry::default() };
    let mut at = 0;
    while let Some((stamp, rest)) =
        bytes.get(at..).and_then(|rest| rest.split_first_chunk::<STAMP>())
    {
        let Some(size) =
            frame(rest).and_then(|found| keep(&mut log, u64::from_be_bytes(*stamp), &found, known))
        else {
            log.lost += 1;
            at += 1;
            continue;
        };
        at += STAMP + size;
        if log.held > budget {
            return Err(LogError::TooLarge { bytes: log.held });
        }
    }
    log.lost += bytes.len() - at;
    Ok(log)
}

fn keep(log: &mut Telemetry, stamp_us: u64, found: &Frame, known: &Known) -> Option<usize> {
    let Some(&(width, seed)) = known.get(&found.message) else {
        return Some(found.size);
    };
    if checksum(found.checked, seed) != found.checksum {
        return None;
    }
    let kept = log.frames.entry((found.message, found.system, found.component)).or_default();
    let taken = &found.payload[..found.payload.len().min(width)];
    kept.stamps_us.push(stamp_us);
    kept.payloads.extend(taken);
    kept.payloads.resize(kept.stamps_us.len() * width, 0);
    log.held += 2 * (STAMP + width);
    Some(found.size)
}

fn frame(bytes: &[u8]) -> Option<Frame<'_>> {
    let &magic = bytes.first()?;
    let length = usize::from(*bytes.get(1)?);
    let (head, signature) = match magic {
        found if found == V1.0 => (V1.1, 0),
        found if found == V2.0 => (V2.1, if bytes.get(2)? & SIGNED != 0 { SIGNATURE } else { 0 }),
        _ => return None,
    };
    let header = bytes.get(..head)?;
    let end = head + length;
    let (system, component, message) = if magic == V1.0 {
        (header[3], header[4], u32::from(header[5]))
    } else {
        (header[5], header[6], u32::from_le_bytes([header[7], header[8], header[9], 0]))
    };
    let sum = bytes.get(end..end + CHECKSUM)?;
    let size = end + CHECKSUM + signature;
    bytes.get(..size)?;
    Some(Frame {
        message,
        system,
        component,
        payload: &bytes[head..end],
        checked: &bytes[1..end],
        checksum: u16::from_le_bytes([sum[0], sum[1]]),
        size,
    })
}

/// CRC-16/MCRF4XX over a frame without its first byte, and the seed of its message.
fn checksum(bytes: &[u8], seed: u8) -> u16 {
    bytes.iter().chain([&seed]).fold(0xFFFF, |sum, &byte| {
        let mixed = byte ^ (sum & 0xFF) as u8;
        let mixed = u16::from(mixed ^ (mixed << 4));
        (sum >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)
    })
}
