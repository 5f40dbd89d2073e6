//! Stones tracked in photos, packed for the page.

use super::block::Block;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use stonewise_core::registration::photos::PhotoStatus;
use stonewise_core::registration::{FaceShift, PhotoShift, StoneEvidence};
use stonewise_results::records::EstimatorRecord;
use stonewise_results::{ResultSet, StoneRow};

const MICROMETRE: f64 = 1e-6;
const MILLIMETRE: f64 = 1e-3;
/// Step of the shifts of single photos, metres, and of their standard deviations.
const SHIFT_STEP_M: f64 = 1e-5;
const SHIFT_SD_STEP_M: f64 = 2e-6;
const CORRELATION_STEP: f64 = 1.0 / 32_767.0;
const HUNDREDTH: f64 = 0.01;

/// One of the displacements of a stone.
type ShiftOf = fn(&StoneEvidence) -> Option<FaceShift>;

/// What the photos say of the stones; `None` where they took no part or the folder does not hold it.
///
/// `status`: of every stone, see [`status_number`]. Then one entry for each tracked stone: displacement by
/// clouds alone, by photos alone and by both, with standard deviations and correlation, edge and photos of its pictures. Last
/// the shifts of single photos; `shiftsEnd`: where those of each stone end. Stones without pictures have none,
/// so that the page of a long wall stays small.
pub(super) fn block(results: &ResultSet) -> Option<Block> {
    let stored = results.evidence.tracks.as_ref()?;
    let rows: BTreeMap<u32, u32> = results.stones.iter().map(|s| s.stone_id).zip(0..).collect();
    let stones: Vec<(u32, &StoneEvidence)> = stored
        .tracks
        .stones
        .iter()
        .filter_map(|(id, evidence)| Some((*rows.get(id)?, evidence)))
        .collect();
    let mut block = Block::default();
    let statuses = statuses(results);
    let status = |s: &StoneRow| statuses.get(&s.stone_id).map_or(0, |s| status_number(*s));
    block.u8("status", results.stones.iter().map(status));
    block.u32("stone", stones.iter().map(|(row, _)| *row));
    let alone: [(&str, ShiftOf); 3] = [
        ("clouds", |s| s.clouds),
        ("photos", |s| s.photos),
        ("both", |s| s.both),
    ];
    for (stem, of) in alone {
        let shifts: Vec<Option<FaceShift>> = stones.iter().map(|(_, s)| of(s)).collect();
        push_shifts(&mut block, stem, &shifts);
    }
    let pictures = || stones.iter().map(|(_, s)| s.pictures.as_ref());
    block.i16(
        "edge",
        MILLIMETRE,
        pictures().map(|p| p.map_or(f64::NAN, |p| p.edge_m)),
    );
    for epoch in [0, 1] {
        let photo = pictures().map(|p| p.map_or(0, |p| photo_number(p.photos[epoch])));
        block.u16(&format!("photo{}", epoch + 1), 1.0, photo);
    }
    let shown: Vec<&[PhotoShift]> = stones
        .iter()
        .map(|(_, s)| s.pictures.as_ref().map_or(&[][..], |_| s.shifts.as_slice()))
        .collect();
    push_single(&mut block, &shown);
    Some(block)
}

/// Columns of displacements in the face.
fn push_shifts(block: &mut Block, stem: &str, shifts: &[Option<FaceShift>]) {
    let of = |value: fn(&FaceShift) -> f64| -> Vec<f64> {
        { shifts.iter() }
            .map(|s| s.as_ref().map_or(f64::NAN, value))
            .collect()
    };
    block.i32(&format!("{stem}Along"), MICROMETRE, of(|s| s.shift_m[0]));
    block.i32(&format!("{stem}Up"), MICROMETRE, of(|s| s.shift_m[1]));
    block.i32(&format!("{stem}SdAlong"), MICROMETRE, of(|s| sd(s)[0]));
    block.i32(&format!("{stem}SdUp"), MICROMETRE, of(|s| sd(s)[1]));
    block.i16(&format!("{stem}Correlation"), CORRELATION_STEP, of(correlation));
}

/// Columns of the shifts of single photos.
fn push_single(block: &mut Block, stones: &[&[PhotoShift]]) {
    let ends = stones.iter().scan(0u32, |end, shifts| {
        *end += shifts.len() as u32;
        Some(*end)
    });
    block.u32("shiftsEnd", ends);
    let all = || stones.iter().flat_map(|s| s.iter());
    block.u8("later", all().map(|s| s.epoch as u8));
    block.u16("photo", 1.0, all().map(|s| photo_number(s.photo)));
    block.i16("along", SHIFT_STEP_M, all().map(|s| s.shift.shift_m[0]));
    block.i16("up", SHIFT_STEP_M, all().map(|s| s.shift.shift_m[1]));
    block.i16("sdAlong", SHIFT_SD_STEP_M, all().map(|s| sd(&s.shift)[0]));
    block.i16("sdUp", SHIFT_SD_STEP_M, all().map(|s| sd(&s.shift)[1]));
    block.i8("correlation", HUNDREDTH, all().map(|s| correlation(&s.shift)));
    block.i8("weight", HUNDREDTH, all().map(|s| s.weight));
}

fn photo_number(number: usize) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

fn sd(shift: &FaceShift) -> [f64; 2] {
    let [along, _, up] = shift.covariance_m2;
    [along, up].map(|variance| variance.max(0.0).sqrt())
}

fn correlation(shift: &FaceShift) -> f64 {
    let [along, up] = sd(shift);
    match along > 0.0 && up > 0.0 {
        true => shift.covariance_m2[1] / (along * up),
        false => 0.0,
    }
}

/// What became of the matched stones in the photos.
fn statuses(results: &ResultSet) -> BTreeMap<u32, PhotoStatus> {
    let estimator = results.registration.as_ref().map(|r| &r.estimator);
    let Some(EstimatorRecord::Adjustment(adjustment)) = estimator else {
        return BTreeMap::new();
    };
    let stones = adjustment.photos.iter().flat_map(|p| &p.stones);
    stones.map(|s| (s.stone_id, s.photos.status)).collect()
}

/// Number of a status in the page; 0 stands for a stone that was not tracked in the photos.
fn status_number(status: PhotoStatus) -> u8 {
    match status {
        PhotoStatus::Tracked => 1,
        PhotoStatus::FewPhotos => 2,
        PhotoStatus::SmallFace => 3,
        PhotoStatus::NoTemplate => 4,
        PhotoStatus::NotFound => 5,
        PhotoStatus::Ambiguous => 6,
    }
}

/// How the pictures are laid out; null where there are none.
pub(super) fn layout(results: &ResultSet) -> Value {
    let stored = results.evidence.tracks.as_ref();
    stored.map_or(Value::Null, |stored| {
        json!({
            "side": stored.side_px,
            "perRow": stored.per_row,
            "photos": stored.tracks.photos,
        })
    })
}

/// The pictures as elements of the page.
pub(super) fn pictures(results: &ResultSet) -> String {
    let mut out = String::new();
    let stored = results.evidence.tracks.iter();
    for (number, picture) in stored.flat_map(|s| &s.pictures).enumerate() {
        let text = STANDARD.encode(picture);
        let _ = writeln!(
            out,
            "<script type=\"text/plain\" id=\"tracks-{number}\">{text}</script>"
        );
    }
    out
}
