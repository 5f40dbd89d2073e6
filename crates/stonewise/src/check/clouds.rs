//! Extents, units, coordinate systems, overlap and spacing of the clouds.

use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::project::Project;
use nalgebra::Vector3;
use stonewise_core::geometry::Bounds;
use stonewise_io::crs::Crs;

/// Metres in a unit that somebody may have exported, by its name.
const UNITS: [(&str, f64); 4] = [
    ("feet", 0.3048),
    ("inches", 0.0254),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
];
/// Ratios of the longer extents that differ from that of two units by less than this share are taken for it.
const UNIT_TOLERANCE: f64 = 0.04;
/// No structure that is surveyed in one piece is longer, metres.
const LONGEST_M: f64 = 20_000.0;
/// Nothing of masonry that can be measured stone by stone is smaller, metres.
const SMALLEST_M: f64 = 0.3;
/// Epochs of which a smaller share overlaps are doubtful.
const LEAST_OVERLAP: f64 = 0.5;
/// A spacing beyond this shows no stone's relief, metres.
const WIDEST_SPACING_M: f64 = 0.05;

pub(super) fn look(project: &Project, surveys: &[Sample]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (epoch, survey) in project.epochs.iter().zip(surveys) {
        found.push(extent(&epoch.name, survey));
        found.push(spacing(&epoch.name, survey));
        found.extend(unit_of_system(&epoch.name, survey));
    }
    found.push(systems(project, surveys));
    let boxes: Vec<Option<Bounds>> = surveys.iter().map(|s| s.bounds).collect();
    let Some(first) = boxes.first().copied().flatten() else {
        return found;
    };
    for (epoch, bounds) in project.epochs.iter().zip(&boxes).skip(1) {
        let Some(bounds) = bounds else { continue };
        let names = [project.epochs[0].name.as_str(), epoch.name.as_str()];
        match unit_ratio(&first, bounds) {
            Some(why) => found.push(Finding::new(names[1], "units", Verdict::Wrong, why)),
            None => found.push(overlap(names, &first, bounds)),
        }
    }
    found.extend(same_file(project));
    found
}

fn size(bounds: &Bounds) -> Vector3<f64> {
    bounds.max - bounds.min
}

fn extent(name: &str, survey: &Sample) -> Finding {
    let Some(bounds) = &survey.bounds else {
        return Finding::new(name, "extent", Verdict::Wrong, "the clouds hold no points");
    };
    let size = size(bounds);
    let text = format!(
        "{:.1} x {:.1} x {:.1} m, {} points",
        size.x, size.y, size.z, survey.records
    );
    let (longest, verdict, advice) = (size.max(), Verdict::Wrong, ": are the coordinates in metres?");
    if longest > LONGEST_M {
        return Finding::new(
            name,
            "extent",
            verdict,
            format!("{text}{advice} Cut the cloud to the structure"),
        );
    }
    if longest < SMALLEST_M {
        return Finding::new(name, "extent", Verdict::Doubt, format!("{text}{advice}"));
    }
    Finding::new(name, "extent", Verdict::Fine, text)
}

fn spacing(name: &str, survey: &Sample) -> Finding {
    match survey.spacing_m {
        Some(m) if m <= WIDEST_SPACING_M => {
            Finding::new(name, "point spacing", Verdict::Fine, format!("{:.1} mm", 1e3 * m))
        }
        Some(m) => Finding::new(
            name,
            "point spacing",
            Verdict::Doubt,
            format!("{:.0} mm: too wide to show the relief of single stones", 1e3 * m),
        ),
        None => Finding::new(name, "point spacing", Verdict::Doubt, "too few points to tell"),
    }
}

/// A coordinate system whose unit is not the metre.
fn unit_of_system(name: &str, survey: &Sample) -> Option<Finding> {
    let crs = survey.crs.iter().flatten().map(|c| c.to_ascii_lowercase());
    let unit = |text: String| {
        let is_geographic =
            text.starts_with("geogcs") || text.starts_with("geogcrs") || text.starts_with("geodcrs");
        let feet = [
            "unit[\"foot",
            "unit[\"us survey foot",
            "unit[\"foot_us",
            "unit[\"international foot",
        ];
        match () {
            () if is_geographic => Some("degrees"),
            () if feet.iter().any(|f| text.contains(f)) => Some("feet"),
            () => None,
        }
    };
    let unit = crs.filter_map(unit).next()?;
    let text = format!("the clouds' coordinate system is in {unit}: transform them to a system in metres");
    Some(Finding::new(name, "units", Verdict::Wrong, text))
}

/// One system for all clouds.
fn systems(project: &Project, surveys: &[Sample]) -> Finding {
    let mut codes: Vec<(i32, &str)> = Vec::new();
    let (mut named, mut all) = (0, 0);
    for (epoch, survey) in project.epochs.iter().zip(surveys) {
        for crs in &survey.crs {
            all += 1;
            if let Some(crs) = crs.as_deref().and_then(Crs::parse) {
                named += 1;
                if !codes.iter().any(|(code, _)| *code == crs.epsg) {
                    codes.push((crs.epsg, &epoch.name));
                }
            }
        }
    }
    let topic = "coordinate system";
    match codes.as_slice() {
        [] => Finding::new("", topic, Verdict::Fine, "none named: a local frame"),
        [(code, _)] if named == all => Finding::new("", topic, Verdict::Fine, format!("EPSG:{code}")),
        [(code, _)] => {
            let text =
                format!("EPSG:{code} in {named} of {all} clouds, the others name none; taken as the same");
            Finding::new("", topic, Verdict::Note, text)
        }
        several => {
            let list: Vec<String> = several
                .iter()
                .map(|(code, epoch)| format!("EPSG:{code} ({epoch})"))
                .collect();
            let text = format!(
                "the clouds are in different systems, {}: transform them to one",
                list.join(", ")
            );
            Finding::new("", topic, Verdict::Wrong, text)
        }
    }
}

/// Says so where one epoch is as much larger than the other as one unit than another.
fn unit_ratio(first: &Bounds, second: &Bounds) -> Option<String> {
    let mut axes: Vec<(f64, f64)> = size(first)
        .iter()
        .copied()
        .zip(size(second).iter().copied())
        .collect();
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let ratios: Vec<f64> = axes.iter().take(2).map(|(a, b)| b / a.max(1e-9)).collect();
    let near = |ratio: f64| ratios.iter().all(|r| (r / ratio - 1.0).abs() < UNIT_TOLERANCE);
    UNITS.iter().find_map(|(name, metres)| {
        let (which, ratio) = match () {
            () if near(1.0 / metres) => ("this epoch", 1.0 / metres),
            () if near(*metres) => ("the first epoch", *metres),
            () => return None,
        };
        Some(format!(
            "the clouds are {:.3} times as large as those of the first epoch; {ratio:.3} would mean that {which} is in {name}: \
             export its coordinates in metres",
            ratios[0]
        ))
    })
}

fn overlap([one, other]: [&str; 2], first: &Bounds, second: &Bounds) -> Finding {
    let shared = size(&Bounds {
        min: first.min.sup(&second.min),
        max: first.max.inf(&second.max),
    });
    if shared.min() < 0.0 {
        let text = format!(
            "the clouds do not overlap those of {one}: they reach from {:.1?} to {:.1?} m, {one} from {:.1?} to {:.1?} m; bring both into one frame",
            second.min.coords.as_slice(),
            second.max.coords.as_slice(),
            first.min.coords.as_slice(),
            first.max.coords.as_slice()
        );
        return Finding::new(other, "overlap", Verdict::Wrong, text);
    }
    // A wall is thin in one direction: the two longer ones count.
    let face = |v: Vector3<f64>| v.x * v.y + v.y * v.z + v.z * v.x;
    let smaller = face(size(first)).min(face(size(second)));
    let share = if smaller > 0.0 {
        face(shared) / smaller
    } else {
        1.0
    };
    let text = format!("{:.0} % of the smaller epoch with {one}", 100.0 * share);
    match share < LEAST_OVERLAP {
        true => Finding::new(
            other,
            "overlap",
            Verdict::Doubt,
            format!("{text}: are both in one frame?"),
        ),
        false => Finding::new(other, "overlap", Verdict::Fine, text),
    }
}

/// Two epochs that read the same cloud show no motion.
fn same_file(project: &Project) -> Option<Finding> {
    let epochs = &project.epochs;
    if epochs.iter().any(|e| e.motion.is_some()) {
        return None;
    }
    let canonical = |p: &std::path::PathBuf| p.canonicalize().unwrap_or_else(|_| p.clone());
    for (number, epoch) in epochs.iter().enumerate() {
        for earlier in &epochs[..number] {
            let files: Vec<_> = earlier.clouds.iter().map(canonical).collect();
            if let Some(twice) = epoch.clouds.iter().find(|c| files.contains(&canonical(c))) {
                let text = format!("reads {} like epoch {:?}", twice.display(), earlier.name);
                return Some(Finding::new(&epoch.name, "clouds", Verdict::Doubt, text));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn wall(scale: f64, x: f64) -> Bounds {
        Bounds {
            min: Point3::new(x, -3.0, 0.0) * scale,
            max: Point3::new(x + 1.0, 3.0, 3.4) * scale,
        }
    }

    #[test]
    fn units_are_told_from_walls_of_other_sizes() {
        let metres = wall(1.0, 0.0);
        for (name, unit) in UNITS {
            let other = wall(1.0 / unit, 0.0);
            assert!(
                unit_ratio(&metres, &other)
                    .unwrap()
                    .contains(&format!("this epoch is in {name}")),
                "{name}"
            );
            assert!(
                unit_ratio(&other, &metres)
                    .unwrap()
                    .contains(&format!("first epoch is in {name}")),
                "{name}"
            );
        }
        for scale in [0.5, 0.9, 1.0, 1.1, 2.0, 3.0] {
            assert_eq!(unit_ratio(&metres, &wall(scale, 0.0)), None, "{scale}");
        }
    }

    #[test]
    fn overlap_is_that_of_the_boxes() {
        let at = |x| overlap(["a", "b"], &wall(1.0, 0.0), &wall(1.0, x));
        assert_eq!(at(0.0).verdict, Verdict::Fine);
        assert!(at(0.0).text.starts_with("100 %"));
        assert_eq!(at(2.0).verdict, Verdict::Wrong);
    }
}
