//! Extents, units, coordinate systems, overlap and spacing of the clouds.

use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::{Epoch, Project};
use nalgebra::{Point3, Vector3};
use stonewise_base::messages::findings::{
    CENTIMETRES, CLOUDS, CONVERTED, DEGREES, EXTENT, FEET, FIRST_EPOCH, HEIGHTS_CONVERTED, INCHES,
    LITTLE_OVERLAP, METRES, MILLIMETRES, NO_OVERLAP, NO_POINTS, OVERLAP, SAME_FILE, SIZED_FEET, SIZED_UNIT,
    SPACING, SPACING_UNKNOWN, SPACING_VIEWS, SPACING_WIDE, SYSTEM, SYSTEM_UNIT, SYSTEMS, THIS_EPOCH,
    TOO_LONG, TOO_SMALL, UNIT_RATIO, UNITS,
};
use stonewise_base::messages::notices::UNUSED_POINTS;
use stonewise_base::messages::{Message, Said};
use stonewise_base::settings::Align;
use stonewise_core::geometry::Bounds;
use stonewise_io::crs::{Crs, Units, is_foot};

/// Metres in a unit that somebody may have exported, by its name.
static UNIT_NAMES: [(&Message, f64); 4] = [
    (&FEET, 0.3048),
    (&INCHES, 0.0254),
    (&CENTIMETRES, 0.01),
    (&MILLIMETRES, 0.001),
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
/// Distances between points across a stone (root of its area) from which on views show nearly all stones
/// (docs/src/accuracy.md).
const FOUND_WELL: f64 = 12.0;

pub(super) fn look(project: &Project, surveys: &[Option<Sample>]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (epoch, survey) in read(project, surveys) {
        found.push(extent(&epoch.name, survey));
        found.push(spacing(epoch, survey));
        found.extend(unit_of_system(&epoch.name, survey));
        found.extend(odd(&epoch.name, survey));
    }
    if surveys.iter().any(Option::is_some) {
        found.push(systems(project, surveys));
    }
    let boxes: Vec<Option<Bounds>> = surveys.iter().map(|s| s.as_ref()?.bounds).collect();
    let Some(first) = boxes.first().copied().flatten() else {
        return found;
    };
    // Boxes of other frames say nothing about each other.
    let is_one_frame = project.settings.registration.align == Align::None;
    for (epoch, bounds) in project.epochs.iter().zip(&boxes).skip(1).filter(|_| is_one_frame) {
        let Some(bounds) = bounds else { continue };
        let names = [project.epochs.reference().name.as_str(), epoch.name.as_str()];
        match unit_ratio(&first, bounds) {
            Some(why) => found.push(Finding::new(names[1], &UNITS, Verdict::Wrong, why)),
            None => found.push(overlap(names, &first, bounds)),
        }
    }
    found.extend(same_file(project));
    found
}

/// Epochs whose clouds were read.
pub(super) fn read<'a>(
    project: &'a Project,
    surveys: &'a [Option<Sample>],
) -> impl Iterator<Item = (&'a Epoch, &'a Sample)> {
    let epochs = project.epochs.iter().zip(surveys);
    epochs.filter_map(|(epoch, survey)| Some((epoch, survey.as_ref()?)))
}

fn size(bounds: &Bounds) -> Vector3<f64> {
    bounds.max - bounds.min
}

fn extent(name: &str, survey: &Sample) -> Finding {
    let Some(bounds) = &survey.bounds else {
        return Finding::new(name, &EXTENT, Verdict::Wrong, NO_POINTS.say(&[]));
    };
    let size = size(bounds);
    let [x, y, z] = [size.x, size.y, size.z].map(|m| format!("{m:.1}"));
    let points = survey.records.to_string();
    let values = [("x", &x), ("y", &y), ("z", &z)].map(|(name, m)| (name, Said::numbers(m.clone())));
    let values = [values.as_slice(), &[("points", points.as_str().into())]].concat();
    let longest = size.max();
    let (verdict, text) = if longest > LONGEST_M {
        (Verdict::Wrong, TOO_LONG.say(&values))
    } else if longest < SMALLEST_M {
        (Verdict::Doubt, TOO_SMALL.say(&values))
    } else {
        (
            Verdict::Fine,
            format!("{x} x {y} x {z} m, {points} points").into(),
        )
    };
    Finding::new(name, &EXTENT, verdict, text)
}

fn spacing(epoch: &Epoch, survey: &Sample) -> Finding {
    let (verdict, text) = match survey.spacing_m {
        Some(m) if m <= WIDEST_SPACING_M && epoch.photos.is_none() => {
            let size_m = FOUND_WELL * m;
            let spacing = Said::numbers(format!("{:.1}", 1e3 * m));
            let size = format!("{:.0}", (1e2 * size_m).ceil());
            let values = [("spacing", spacing), ("size", size.into())];
            (Verdict::Fine, SPACING_VIEWS.say(&values))
        }
        Some(m) if m <= WIDEST_SPACING_M => (Verdict::Fine, format!("{:.1} mm", 1e3 * m).into()),
        Some(m) => {
            let spacing = format!("{:.0}", 1e3 * m);
            (Verdict::Doubt, SPACING_WIDE.say(&[("spacing", spacing.into())]))
        }
        None => (Verdict::Doubt, SPACING_UNKNOWN.say(&[])),
    };
    Finding::new(&epoch.name, &SPACING, verdict, text)
}

/// What the readers say of an epoch's files.
fn odd(name: &str, survey: &Sample) -> Vec<Finding> {
    let remarks = survey.remarks.iter().map(|(file, remark)| {
        let verdict = if remark.is_doubt {
            Verdict::Doubt
        } else {
            Verdict::Note
        };
        Finding::new(name, &CLOUDS, verdict, format!("{file}: {}", remark.text))
    });
    let unused = (survey.unused > 0).then(|| {
        let counts = [survey.unused, survey.passed].map(|n| n.to_string());
        let text = UNUSED_POINTS.say(&[("n", (&*counts[0]).into()), ("all", (&*counts[1]).into())]);
        Finding::new(name, &CLOUDS, Verdict::Note, text)
    });
    remarks.chain(unused).collect()
}

/// Coordinates in units other than metres: those of the file are converted, those of a system that the points are not in
/// cannot be right.
fn unit_of_system(name: &str, survey: &Sample) -> Option<Finding> {
    let wrong = |unit: Said| Finding::new(name, &UNITS, Verdict::Wrong, SYSTEM_UNIT.say(&[("unit", unit)]));
    let read = || {
        survey
            .crs
            .iter()
            .flatten()
            .filter_map(|text| Units::of(text).ok())
    };
    if read()
        .chain(survey.units.iter().copied())
        .any(|units| units.is_geographic)
    {
        return Some(wrong((&DEGREES).into()));
    }
    // E57 says metres, whatever its system says.
    if let Some(units) = read().find(|units| !units.are_metres()) {
        let size_m = if units.plane_m == 1.0 {
            units.height_m
        } else {
            units.plane_m
        };
        return Some(wrong(unit(size_m)));
    }
    let Units {
        plane_m, height_m, ..
    } = survey.units.iter().find(|units| !units.are_metres())?;
    let text = match plane_m == height_m {
        true => CONVERTED.say(&[("unit", unit(*plane_m))]),
        false => HEIGHTS_CONVERTED.say(&[("plane", unit(*plane_m)), ("height", unit(*height_m))]),
    };
    Some(Finding::new(name, &UNITS, Verdict::Note, text))
}

/// A unit by its size.
fn unit(size_m: f64) -> Said {
    let size = [("m", Said::numbers(size_m.to_string()))];
    match () {
        () if size_m == 1.0 => (&METRES).into(),
        () if is_foot(size_m) => SIZED_FEET.say(&size),
        () => SIZED_UNIT.say(&size),
    }
}

/// One system for all clouds.
fn systems(project: &Project, surveys: &[Option<Sample>]) -> Finding {
    let mut codes: Vec<(i32, &str)> = Vec::new();
    let mut own = None;
    let (mut coded, mut all) = (0, 0);
    for (epoch, survey) in read(project, surveys) {
        for crs in &survey.crs {
            all += 1;
            let Some(crs) = crs.as_deref().and_then(Crs::parse) else {
                continue;
            };
            let Some(code) = crs.epsg else {
                own.get_or_insert(crs.name);
                continue;
            };
            coded += 1;
            if !codes.iter().any(|(known, _)| *known == code) {
                codes.push((code, &epoch.name));
            }
        }
    }

    let topic = &SYSTEM;
    match codes.as_slice() {
        [] => {
            let text = own.map_or("none named: a local frame".to_owned(), |name| {
                format!("{name}, without a code")
            });
            Finding::new("", topic, Verdict::Fine, text)
        }
        [(code, _)] if coded == all => Finding::new("", topic, Verdict::Fine, format!("EPSG:{code}")),
        [(code, _)] => {
            let text =
                format!("EPSG:{code} in {coded} of {all} clouds, the others name no code; taken as the same");
            Finding::new("", topic, Verdict::Note, text)
        }
        several => {
            let list: Vec<String> = several
                .iter()
                .map(|(code, epoch)| format!("EPSG:{code} ({epoch})"))
                .collect();
            let text = SYSTEMS.say(&[("systems", list.join(", ").into())]);
            Finding::new("", topic, Verdict::Wrong, text)
        }
    }
}

/// Says so where one epoch is as much larger than the other as one unit than another.
fn unit_ratio(first: &Bounds, second: &Bounds) -> Option<Said> {
    let mut axes: Vec<(f64, f64)> = size(first)
        .iter()
        .copied()
        .zip(size(second).iter().copied())
        .collect();
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let ratios: Vec<f64> = axes.iter().take(2).map(|(a, b)| b / a.max(1e-9)).collect();
    let near = |ratio: f64| ratios.iter().all(|r| (r / ratio - 1.0).abs() < UNIT_TOLERANCE);
    UNIT_NAMES.iter().find_map(|(unit, metres)| {
        let (which, ratio) = match () {
            () if near(1.0 / metres) => (&THIS_EPOCH, 1.0 / metres),
            () if near(*metres) => (&FIRST_EPOCH, *metres),
            () => return None,
        };
        let [found, ratio] = [ratios[0], ratio].map(|r| Said::numbers(format!("{r:.3}")));
        Some(UNIT_RATIO.say(&[
            ("found", found),
            ("ratio", ratio),
            ("which", which.into()),
            ("unit", (*unit).into()),
        ]))
    })
}

fn overlap([one, other]: [&str; 2], first: &Bounds, second: &Bounds) -> Finding {
    let shared = size(&Bounds {
        min: first.min.sup(&second.min),
        max: first.max.inf(&second.max),
    });

    if shared.min() < 0.0 {
        let corners = [second.min, second.max, first.min, first.max];
        let place = |p: Point3<f64>| Said::list(&[p.x, p.y, p.z].map(|m| format!("{m:.1}")));
        let [low, high, first_low, first_high] = corners.map(place);
        let text = NO_OVERLAP.say(&[
            ("first", one.into()),
            ("low", low),
            ("high", high),
            ("first_low", first_low),
            ("first_high", first_high),
        ]);
        return Finding::new(other, &OVERLAP, Verdict::Wrong, text);
    }

    // A wall is thin in one direction: the two longer ones count.
    let face = |v: Vector3<f64>| v.x * v.y + v.y * v.z + v.z * v.x;
    let smaller = face(size(first)).min(face(size(second)));
    let share = if smaller > 0.0 {
        face(shared) / smaller
    } else {
        1.0
    };
    let percent = format!("{:.0}", 100.0 * share);
    let (verdict, text) = match share < LEAST_OVERLAP {
        true => (
            Verdict::Doubt,
            LITTLE_OVERLAP.say(&[("share", percent.into()), ("first", one.into())]),
        ),
        false => (
            Verdict::Fine,
            format!("{percent} % of the smaller epoch with {one}").into(),
        ),
    };

    Finding::new(other, &OVERLAP, verdict, text)
}

/// Two epochs that read the same cloud show no motion.
fn same_file(project: &Project) -> Option<Finding> {
    let epochs = &project.epochs;
    if epochs.iter().any(|e| e.motion.is_some()) {
        return None;
    }
    let canonical = |p: &std::path::PathBuf| p.canonicalize().unwrap_or_else(|_| p.clone());
    for (number, epoch) in epochs.iter().enumerate() {
        for earlier in epochs.iter().take(number) {
            let files: Vec<_> = earlier.clouds.iter().map(canonical).collect();
            if let Some(twice) = epoch.clouds.iter().find(|c| files.contains(&canonical(c))) {
                let (file, name) = (twice.display().to_string(), format!("{:?}", earlier.name));
                let text = SAME_FILE.say(&[("file", file.into()), ("first", name.into())]);
                return Some(Finding::new(&epoch.name, &CLOUDS, Verdict::Doubt, text));
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
        // International units: one inch is 25.4 mm (1959), a foot twelve of them.
        let units = [
            ("feet", 12.0 * 0.0254),
            ("inches", 0.0254),
            ("centimetres", 0.01),
            ("millimetres", 0.001),
        ];
        for (name, unit) in units {
            let other = wall(1.0 / unit, 0.0);
            assert!(
                unit_ratio(&metres, &other)
                    .unwrap()
                    .english
                    .contains(&format!("this epoch is in {name}")),
                "{name}"
            );
            assert!(
                unit_ratio(&other, &metres)
                    .unwrap()
                    .english
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
