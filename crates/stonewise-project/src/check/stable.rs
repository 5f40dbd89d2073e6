//! Stable areas that hold nothing.

use super::clouds::read;
use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::Project;
use stonewise_base::messages::findings::{CLOUDS, STABLE_EMPTY};
use stonewise_base::stable::StableArea;

/// Looks for stable areas in which an epoch has no points.
pub(super) fn look(project: &Project, surveys: &[Option<Sample>]) -> Vec<Finding> {
    let areas = &project.settings.registration.stable;
    let mut found = Vec::new();
    for (epoch, survey) in read(project, surveys) {
        for (number, area) in (1..).zip(areas) {
            if is_empty(area, survey) {
                let text = STABLE_EMPTY.say(&[("area", area.said(number))]);
                found.push(Finding::new(&epoch.name, &CLOUDS, Verdict::Doubt, text));
            }
        }
    }
    found
}

/// Whether an area certainly holds no point: where not all points were read, by their bounds.
fn is_empty(area: &StableArea, survey: &Sample) -> bool {
    let is_apart = match (&survey.bounds, area.bounds()) {
        (Some(points), Some(area)) => !points.intersects(&area),
        _ => true,
    };
    is_apart || survey.is_whole() && !survey.points.iter().any(|p| area.contains(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use stonewise_core::geometry::Bounds;

    #[test]
    fn an_area_is_empty_where_no_point_lies_in_it() {
        let points: Vec<Point3<f64>> = (0..100)
            .map(|i| Point3::new(0.1 * f64::from(i), 0.0, 0.0))
            .collect();
        let survey = |records| Sample {
            bounds: Bounds::of(points.iter().copied()),
            records,
            passed: points.len() as u64,
            points: points.clone(),
            ..Sample::default()
        };
        let area = |from: f64, to: f64| -> StableArea {
            toml::from_str(&format!("corners = [[{from}, -1.0, -1.0], [{to}, 1.0, 1.0]]")).unwrap()
        };
        let between_points = area(1.02, 1.08);
        assert!(!is_empty(&area(0.95, 1.05), &survey(100)));
        assert!(is_empty(&between_points, &survey(100)));
        assert!(
            !is_empty(&between_points, &survey(200)),
            "points that were not read may lie there"
        );
        assert!(is_empty(&area(20.0, 21.0), &survey(200)));
    }
}
