//! The coordinate system of a survey.

use crate::error::Result;
use crate::project::Project;
use stonewise_io::cloud::cloud_crs;
use stonewise_io::crs::Crs;

/// The system that the first epoch's clouds name; `None` for a local frame, or where they name different
/// ones.
pub fn coordinate_system(project: &Project) -> Result<Option<Crs>> {
    let mut found: Option<Crs> = None;
    for cloud in project.epochs.iter().take(1).flat_map(|e| &e.clouds) {
        let named = cloud_crs(cloud)?.as_deref().and_then(Crs::parse);
        match (&found, named) {
            (None, Some(crs)) => found = Some(crs),
            (Some(known), Some(crs)) if differ(known, &crs) => return Ok(None),
            _ => {}
        }
    }
    Ok(found)
}

/// Whether the codes of two systems differ.
fn differ(one: &Crs, other: &Crs) -> bool {
    one.epsg.zip(other.epsg).is_some_and(|(a, b)| a != b)
}
