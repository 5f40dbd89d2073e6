//! A part of a survey as people write it.

use anyhow::{Context, Result, bail};
use stonewise::{Part, Project};

/// Reads `x0,y0,z0,x1,y1,z1`, or `WIDTHxHEIGHT` for the middle of what the first epoch shows. `option`: its
/// name, for messages.
pub fn part(option: &str, text: &str, project: &Project) -> Result<Part> {
    let numbers = |separator: char| -> Vec<f64> {
        let parsed = text
            .split(separator)
            .map(|n| n.trim().parse().unwrap_or(f64::NAN));
        parsed.collect()
    };
    let (corners, size) = (numbers(','), numbers('x'));
    match (corners.as_slice(), size.as_slice()) {
        (&[x0, y0, z0, x1, y1, z1], _) if corners.iter().all(|c| c.is_finite()) => {
            Ok(Part::between([x0, y0, z0], [x1, y1, z1]))
        }
        (_, &[width, height]) if width > 0.0 && height > 0.0 => {
            let epoch = project.epochs.first().context("the project has no epochs")?;
            Ok(Part::in_the_middle(&epoch.clouds, [width, height])?)
        }
        _ => bail!(
            "{option} {text:?}: write x0,y0,z0,x1,y1,z1 (metres, world frame) or WIDTHxHEIGHT such as 5x5"
        ),
    }
}
