//! What was tracked in photos, kept for the report: numbers as JSON, pixels of all pictures one after another.

use crate::error::{Error, Result};
use crate::files::{read_bytes, read_json, write_json};
use crate::results::Tracks;
use crate::storage::step::StepDir;
use std::path::Path;
use stonewise_core::registration::AdjustmentReport;
use stonewise_io::atomic::write_atomically;

/// Numbers of all stones.
const NUMBERS: &str = "tracks.json";
/// Grey values in the first epoch, in the second, and difference, stone by stone in the order of the numbers.
const PIXELS: &str = "tracks.grey";

/// Writes the files, if photos took part.
pub(super) fn write(step: &StepDir, report: &AdjustmentReport) -> Result<()> {
    let Some(photos) = &report.photos else {
        return Ok(());
    };
    let pairs = report.results.iter().zip(&photos.evidence);
    let mut tracks = Tracks {
        photos: photos.poses_px.iter().map(|(name, _)| name.clone()).collect(),
        stones: pairs
            .filter_map(|(pair, evidence)| Some((pair.first.0, evidence.clone()?)))
            .collect(),
    };
    tracks.stones.sort_by_key(|(id, _)| *id);
    let mut bytes = Vec::new();
    for pictures in tracks.stones.iter().filter_map(|(_, s)| s.pictures.as_ref()) {
        let [first, second] = &pictures.grey;
        for part in [first, second, &pictures.difference] {
            bytes.extend_from_slice(part);
        }
    }
    let path = step.file(PIXELS);
    write_atomically(&path, |partial| std::fs::write(partial, &bytes))
        .map_err(Error::io("writing", &path))?;
    write_json(&step.file(NUMBERS), &tracks)
}

/// Reads the files of a step; `None` where photos took no part.
pub(super) fn read(folder: &Path) -> Result<Option<Tracks>> {
    let numbers = folder.join(NUMBERS);
    if !numbers.exists() {
        return Ok(None);
    }
    let mut tracks: Tracks = read_json(&numbers)?;
    let bytes = read_bytes(&folder.join(PIXELS))?;
    let mut rest = bytes.as_slice();
    for pictures in tracks.stones.iter_mut().filter_map(|(_, s)| s.pictures.as_mut()) {
        let mut take = || {
            let (part, after) = rest.split_at_checked(pictures.side_px * pictures.side_px)?;
            rest = after;
            Some(part.to_vec())
        };
        let parts = (take(), take(), take());
        let (Some(first), Some(second), Some(difference)) = parts else {
            return Err(Error::Input {
                path: folder.join(PIXELS),
                message: "is shorter than its stones say; remove its folder".to_owned(),
            });
        };
        pictures.grey = [first, second];
        pictures.difference = difference;
    }
    Ok(Some(tracks))
}
