//! What the points of an epoch come from, and which bundle adjusted its photos.

use crate::project_type::{Epoch, Origin, Project};
use std::ops::ControlFlow;
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::Camera;
use stonewise_io::cloud::{PointChunk, read_first};

/// Points of a file that are looked at.
const POINTS: usize = 100_000;

impl Epoch {
    /// What its points come from: as the project states it, else as the files show it. Scanners record how strong the
    /// echo of each point was, or when they measured it; points from photos have only colours. `None`: neither shows.
    ///
    /// # Errors
    /// A cloud cannot be read.
    pub fn found_origin(&self) -> Result<Option<Origin>> {
        if self.origin.is_some() {
            return Ok(self.origin);
        }
        let mut found = None;
        for cloud in &self.clouds {
            match of_file(cloud)? {
                Some(Origin::Scanner) => return Ok(Some(Origin::Scanner)),
                origin => found = found.or(origin),
            }
        }
        Ok(found)
    }
}

/// What the first points of a file show.
fn of_file(path: &Path) -> Result<Option<Origin>> {
    let mut found = None;
    read_first(path, POINTS, |chunk| {
        found = of_points(chunk);
        ControlFlow::Break(())
    })?;
    Ok(found)
}

fn of_points(chunk: &PointChunk) -> Option<Origin> {
    fn varies<T: PartialEq>(values: Option<&Vec<T>>) -> bool {
        values.is_some_and(|all| all.iter().any(|v| *v != all[0]))
    }
    match () {
        () if varies(chunk.intensities.as_ref()) || varies(chunk.times_s.as_ref()) => Some(Origin::Scanner),
        () if varies(chunk.colors.as_ref()) => Some(Origin::Photos),
        () => None,
    }
}

impl Project {
    /// Whether one bundle adjusted the photos of two epochs: both name the same one, or name none and have a camera in
    /// common whose parameters agree in all digits, as those of two adjustments never do.
    pub fn is_one_bundle<'a>(
        &self,
        epochs: [EpochId; 2],
        cameras: [impl Iterator<Item = &'a Camera> + Clone; 2],
    ) -> bool {
        let [first, later] = epochs.map(|epoch| self.epochs[epoch].bundle.as_ref());
        match (first, later) {
            (None, None) => {
                let [first, later] = cameras;
                first.into_iter().any(|a| later.clone().any(|b| a == b))
            }
            (first, later) => first == later,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intensities_show_a_scanner_and_colours_alone_photos() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cloud.xyz");
        let found = |line: fn(u32) -> String| {
            std::fs::write(&path, (0..20).map(line).collect::<String>()).unwrap();
            of_file(&path).unwrap()
        };
        let scanned = found(|k| format!("{k} 0.5 1.5 {} 80 90 {}\n", 100 + k, 0.1 * f64::from(k)));
        assert_eq!(scanned, Some(Origin::Scanner));
        let matched = found(|k| format!("{k} 0.5 1.5 {} 80 90\n", 100 + k));
        assert_eq!(matched, Some(Origin::Photos));
        assert_eq!(found(|k| format!("{k} 0.5 1.5\n")), None);
    }
}
