//! Edits from other programs.

use super::edits_file::{Edit, EditsFile};
use super::signed::Signed;
use super::{from_coco, from_layer};
use nalgebra::Point3;
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_results::ResultSet;

/// Places on two unrolled walls that are the same differ by less, metres: less than anyone draws.
const SAME_WALL_M: f64 = 0.001;

/// Edits that another program made.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The edits, those of an earlier file first where they were appended.
    pub file: EditsFile,
    /// How many are new.
    pub new: usize,
    /// Notes for the user, one sentence each: features that are no edit.
    pub notes: Vec<String>,
}

/// Reads edits from `stones.gpkg`, whose layer `stones_facade` was edited, or from a COCO file whose
/// categories are named after edits.
///
/// `results`: the results from which the GeoPackage was taken: what differs from them are the edits. `epoch`:
/// of the photos of a COCO file. `earlier`: edits that these results had already; the new ones follow them.
///
/// # Errors
/// A file cannot be read, or is neither; the results were unrolled otherwise than the earlier edits.
pub fn import(
    source: &Path,
    results: Option<&Path>,
    epoch: Option<&str>,
    signed: &Signed,
    earlier: EditsFile,
) -> Result<Imported> {
    let is_json = source.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let mut file = earlier;
    let (edits, notes) = if is_json {
        from_coco::edits(source, epoch, signed)?
    } else {
        let beside = source.parent().filter(|p| !p.as_os_str().is_empty());
        let dir = results.or(beside).unwrap_or(Path::new("."));
        let results = ResultSet::read(dir)?;
        let facade = file.facade.get_or_insert_with(|| results.facade.clone());
        let apart = |c: &Point3<f64>| (facade.place(c) - results.facade.place(c)).norm();
        if results.stones.iter().any(|s| apart(&s.centroid) > SAME_WALL_M) {
            return Err(Error::Input {
                path: dir.to_path_buf(),
                message: format!(
                    "these results unroll the wall otherwise than the earlier edits in {}: write to another file",
                    file.path.display()
                ),
            });
        }
        from_layer::edits(source, &results, signed)?
    };

    if let Some((index, message)) = edits
        .iter()
        .enumerate()
        .find_map(|(i, e)| Some((i, e.mistake()?)))
    {
        return Err(Error::Input {
            path: source.to_path_buf(),
            message: format!("edit {}, {}: {message}", index + 1, edits[index].action.word()),
        });
    }

    let new = edits.len();
    file.edits.extend::<Vec<Edit>>(edits);
    Ok(Imported { file, new, notes })
}
