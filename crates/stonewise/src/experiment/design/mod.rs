//! What the next survey will be able to see, from the first one alone.
//!
//! The clouds of the first epoch stand for those of a repetition, with errors of registration of their own: every
//! station is moved as much as the stations of the epoch are found to be off. The photos are divided at random between
//! the two. What the adjustment then says of its accuracy is what it will say of a repetition.

use crate::error::{Error, Result};
use crate::experiment::halves::halves_of;
use crate::experiment::quiet::Quiet;
use crate::figure::{Axis, Item, Page, Plot, table};
use crate::files::{write_readable_json, write_text};
use crate::pipeline::{Context, Run, Until};
use crate::project::{Epoch, Project};
use crate::results::records::DatumState;
use crate::results::{RowMotion, StoneRow, facade_of, read_outlines};
use crate::sources::SourceRule;
use crate::storage::step::Key;
use crate::storage::store::{Keeps, StepStore};
use nalgebra::{Matrix3, Point3, Vector3};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{Deformation, ZONE_EXTENTS_M};
use stonewise_core::statistics::{median, split_mix};
use stonewise_io::cloud::{Observed, cloud_crs, measure_cloud, read_cloud, stream_points_laz};
use stonewise_io::table::{Table, write_csv, write_parquet};

/// Points that pass by at once.
const CHUNK: usize = 1 << 18;
/// How far points may be moved beyond the box of a cloud, metres.
const AROUND_M: f64 = 1.0;
/// What the table as a whole holds.
const DESCRIPTION: &str = "One row per stone of the first epoch: standard deviations that a repetition of the survey \
    will give. Empty cells: the stone will not be measured.";

/// What a repetition of a survey will see.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// The epoch that is repeated.
    pub epoch: String,
    /// Seed of the stations' errors and of the division of the photos.
    pub seed: u64,
    /// Stones of the epoch, and those of them that will be measured.
    pub stones: [usize; 2],
    /// Stones that will not be measured, by their status.
    pub not_measured: BTreeMap<String, usize>,
    /// What is known of the registration of such a survey: `sources`, `stable`, `stated`, or `unknown`, where motions are
    /// relative to the common motion.
    pub datum: DatumState,
    /// Median standard deviations of a stone's motion along the wall, up and out, millimetres.
    pub sd_mm: [Option<f64>; 3],
    /// Median standard deviations of a stone's deformation along the wall, up and out, millimetres.
    pub sd_deformation_mm: [Option<f64>; 3],
    /// Smallest bulge of 1, 3 and 10 m that is found in 95 of 100 cases, in the median over the wall; absent where the
    /// wall is smaller.
    pub zones_mm: [Option<f64>; 3],
    /// Smallest motion in the face of a zone of 1, 3 and 10 m that is found in 95 of 100 cases, along the wall or up,
    /// whichever is found worse, in the median over the wall, millimetres; absent where the wall is smaller.
    pub zones_in_face_mm: [Option<f64>; 3],
    /// Number of stations or strips of the epoch; 1 where its files keep none apart.
    pub sources: usize,
    /// `sd_mm` with one more station or strip that sees what the others see on average.
    pub sd_with_one_more_mm: [Option<f64>; 3],
    /// `sd_mm` if the stable areas were perfect: what the registration of the epochs no longer adds.
    pub sd_without_registration_mm: [Option<f64>; 3],
}

/// What a repetition says of one stone; standard deviations along, up and out.
struct Expected {
    sd: [f64; 3],
    deformation: [Option<f64>; 3],
    one_more: [f64; 3],
    without_registration: [f64; 3],
}

/// Predicts what a repetition of the project's first survey will see; writes `design.json`, `design.csv`,
/// `design.parquet` and `design.html` into `out`. An interrupted prediction goes on where it stopped.
///
/// # Errors
/// What stops the registration of the two halves; no stone can be measured.
pub fn design(project: &Project, seed: u64, out: &Path, progress: &dyn Progress) -> Result<Design> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let quiet = Quiet(progress);
    progress.begin("the survey and its repetition", 3);
    let mut repeated = halves_of(project, project.epochs.reference(), seed, &store, &quiet)?;
    let later = EpochId::at(1);

    for epoch in repeated.epochs.iter_mut() {
        epoch.clouds.clone_from(&project.epochs.reference().clouds);
        // A repetition is registered anew.
        epoch.same_survey_as = None;
    }

    progress.advance(1);
    let folder = out.join("repetition");
    let components = {
        let context = Context::with_store(&repeated, &folder, Arc::clone(&store), &quiet)?;
        let registered = Run::new(&context, Until::Registered).registered(later)?;
        registered.epoch_errors.as_ref().and_then(|e| e.components)
    };
    progress.advance(1);

    if let Some(components) = components {
        let sizes = [components.translation_m, components.rotation_m];
        repeated.epochs[later].clouds = moved_clouds(&repeated.epochs[later], sizes, seed, &store)?;
    }

    let context = Context::with_store(&repeated, &folder, store, &quiet)?;
    let run = Run::new(&context, Until::Registered);
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    progress.advance(1);
    let outlines = read_outlines(&folder)?;
    let (errors, relative) = (registered.errors(), registered.relative_errors());
    let sources = registered.epoch_errors.as_ref().map_or(1, |e| {
        let of_first = e.sources.iter().filter(|s| s.epoch == 0);
        of_first.count().max(1)
    });
    let shared_m = registered.epoch_errors.as_ref().map_or(0.0, |e| e.shared_error_m);
    let is_known = measured.datum.state != DatumState::Unknown;

    let expected = |row: &StoneRow, motion: &RowMotion| {
        let stone = StoneId(row.stone_id);
        let of_registration = match is_known {
            true => errors.get(&stone).map(|e| e.covariance),
            false => relative.get(&stone).map(|c| **c),
        };
        let normal = outlines.get(&row.stone_id).map(|o| o.normal);
        let face = FaceFrame::from_normal(&normal.unwrap_or_default()).face_from_world();
        let [all, registration] = [motion.covariance, of_registration.unwrap_or_default()]
            .map(|covariance| variances(&(face * covariance * face.transpose())));
        // What both epochs share by assumption stays, whatever the number of stations.
        let shared = if is_known { 2.0 * shared_m * shared_m } else { 0.0 };
        expect(all, registration, shared, sources, motion.deformation_sd)
    };

    let all: Vec<Option<Expected>> = measured
        .rows
        .iter()
        .map(|row| row.motion.as_ref().map(|motion| expected(row, motion)))
        .collect();
    let found: Vec<&Expected> = all.iter().flatten().collect();

    if found.is_empty() {
        return Err(Error::Survey(
            "no stone was measured: the survey shows no stone well enough".to_owned(),
        ));
    }

    let medians = |of: &dyn Fn(&Expected, usize) -> Option<f64>| {
        [0, 1, 2].map(|axis| {
            let mut values: Vec<f64> = found.iter().filter_map(|e| of(e, axis)).collect();
            median(&mut values).map(|sd| 1e3 * sd)
        })
    };

    let limits_mm = |of: &dyn Fn(&Deformation) -> [Option<f64>; 3]| {
        let limits_m = registered.deformation.as_ref().map_or([None; 3], of);
        limits_m.map(|limit| limit.map(|m| 1e3 * m))
    };
    let design = Design {
        epoch: project.epochs.reference().name.clone(),
        seed,
        stones: [all.len(), found.len()],
        not_measured: { measured.rows.iter() }.filter(|row| row.motion.is_none()).fold(
            BTreeMap::new(),
            |mut counts, row| {
                *counts.entry(row.status.to_string()).or_default() += 1;
                counts
            },
        ),
        datum: measured.datum.state,
        sd_mm: medians(&|e, axis| Some(e.sd[axis])),
        sd_deformation_mm: medians(&|e, axis| e.deformation[axis]),
        zones_mm: limits_mm(&|d| d.detection_limits_m),
        zones_in_face_mm: limits_mm(&|d| d.limits_in_face_m),
        sources,
        sd_with_one_more_mm: medians(&|e, axis| Some(e.one_more[axis])),
        sd_without_registration_mm: medians(&|e, axis| Some(e.without_registration[axis])),
    };

    write_readable_json(&out.join("design.json"), &design)?;
    let table = stones(&measured.rows, &all)?;
    write_parquet(&out.join("design.parquet"), &table)?;
    write_csv(&out.join("design.csv"), &table, DESCRIPTION, Some("stone_id"))?;
    let facade = facade_of(measured.rows.iter().map(|r| (r.stone_id, r.centroid)), &outlines);
    let places: Vec<[f64; 2]> = measured
        .rows
        .iter()
        .map(|row| facade.place(&row.centroid))
        .map(|p| [p.x, p.y])
        .collect();
    write_text(&out.join("design.html"), &page(&design, &places, &all))?;
    Ok(design)
}

/// How far a station of the repetition is off: a shift and a small rotation about the middle of the cloud.
struct StationError {
    shift: Vector3<f64>,
    turn: Vector3<f64>,
}

impl StationError {
    /// Independent normal numbers with these standard deviations, metres and radians.
    fn draw(station: u64, [shift_m, turn_rad]: [f64; 2], seed: u64) -> Self {
        let normal = |number: u64| {
            let mixed = split_mix(seed ^ split_mix(station ^ split_mix(number)));
            // The middles of 2^53 equal parts: neither 0 nor 1.
            let share = ((mixed >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
            Normal::standard().inverse_cdf(share)
        };
        Self {
            shift: Vector3::from_fn(|axis, _| shift_m * normal(axis as u64)),
            turn: Vector3::from_fn(|axis, _| turn_rad * normal(3 + axis as u64)),
        }
    }

    fn moved(&self, p: &Point3<f64>, middle: &Point3<f64>) -> Point3<f64> {
        p + self.shift + self.turn.cross(&(p - middle))
    }
}

/// The clouds of an epoch with every station moved by an error of its own.
fn moved_clouds(epoch: &Epoch, sizes: [f64; 2], seed: u64, store: &StepStore) -> Result<Vec<PathBuf>> {
    let digests: Vec<String> = epoch
        .clouds
        .iter()
        .map(|cloud| store.digest(cloud))
        .collect::<Result<_>>()?;
    let digests: Vec<&str> = digests.iter().map(String::as_str).collect();
    let key = Key::new("repetition", &(seed, sizes, epoch.sources), &digests);
    let name = |number: usize| format!("cloud_{}.laz", number + 1);
    let (dir, _) = store.step("repetition", key, &[], |dir| {
        for (number, cloud) in epoch.clouds.iter().enumerate() {
            move_cloud(epoch.sources, number, cloud, &dir.file(name(number)), sizes, seed)?;
        }
        Ok(())
    })?;
    Ok((0..epoch.clouds.len())
        .map(|number| dir.file(name(number)))
        .collect())
}

fn move_cloud(
    rule: SourceRule,
    number: usize,
    from: &Path,
    to: &Path,
    sizes: [f64; 2],
    seed: u64,
) -> Result<()> {
    let Some(bounds) = measure_cloud(from)?.1 else {
        return Ok(());
    };
    let (middle, around) = (bounds.centre(), bounds.grown(AROUND_M));
    let crs = cloud_crs(from)?;
    stream_points_laz(to, crs.as_deref(), &around, &[], |sink| {
        read_cloud(from, CHUNK, |chunk| {
            let own = |i: usize| match (&chunk.sources, chunk.scan) {
                (Some(sources), _) => sources[i],
                (None, scan) => scan.unwrap_or(0) as u16,
            };
            let sources: Vec<u16> = (0..chunk.len()).map(own).collect();
            let station = |i: usize| match rule {
                SourceRule::Auto => u64::from(sources[i]) | (number as u64) << 16,
                SourceRule::File => (number as u64) << 16,
                SourceRule::None => 0,
            };
            let mut errors: BTreeMap<u64, StationError> = BTreeMap::new();
            let moved: Vec<Point3<f64>> = chunk
                .positions
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let error = errors
                        .entry(station(i))
                        .or_insert_with(|| StationError::draw(station(i), sizes, seed));
                    error.moved(p, &middle)
                })
                .collect();
            let none = vec![0.0; chunk.len()];
            let observed = Observed {
                sources: &sources,
                times: chunk.times_s.as_deref().unwrap_or(&none),
            };
            Ok::<_, Error>(sink.append_observed(&moved, observed, &[])?)
        })?;
        Ok(())
    })
}

fn variances(covariance: &Matrix3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|axis| covariance[(axis, axis)].max(0.0))
}

/// `all`: variances of a stone's motion, of which `registration` are those of the epochs' errors and `shared` what is
/// assumed that all stations of an epoch share.
fn expect(
    all: [f64; 3],
    registration: [f64; 3],
    shared: f64,
    sources: usize,
    deformation: [Option<f64>; 3],
) -> Expected {
    let noise = [0, 1, 2].map(|axis| (all[axis] - registration[axis]).max(0.0));
    let fewer = sources as f64 / (sources as f64 + 1.0);
    let sd = |of: &dyn Fn(usize) -> f64| [0, 1, 2].map(|axis| of(axis).sqrt());
    Expected {
        sd: sd(&|axis| all[axis]),
        deformation,
        one_more: sd(&|axis| {
            let shared = shared.min(registration[axis]);
            fewer * (noise[axis] + registration[axis] - shared) + shared
        }),
        without_registration: sd(&|axis| noise[axis]),
    }
}

fn stones(rows: &[StoneRow], all: &[Option<Expected>]) -> Result<Table> {
    let mut table = Table::new();
    let ids: Vec<u32> = rows.iter().map(|r| r.stone_id).collect();
    table.push("stone_id", "", "stone of the first epoch", ids)?;

    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f64> = rows.iter().map(|r| r.centroid[axis]).collect();
        table.push(name, "m", &format!("centroid, world {name}"), values)?;
    }

    let areas: Vec<f64> = rows.iter().map(|r| r.area_m2).collect();
    table.push("area_m2", "m2", "area of the visible face", areas)?;
    let status: Vec<String> = rows.iter().map(|r| r.status.to_string()).collect();
    table.push("status", "", "ok, or why there will be no motion", status)?;
    type Of = fn(&Expected, usize) -> Option<f64>;
    let columns: [(&str, &str, Of); 3] = [
        ("sd", "expected standard deviation of the motion", |e, axis| {
            Some(e.sd[axis])
        }),
        (
            "sd_def",
            "expected standard deviation of the deformation",
            |e, axis| e.deformation[axis],
        ),
        (
            "sd_one_more",
            "the same of the motion with one more station or strip",
            |e, axis| Some(e.one_more[axis]),
        ),
    ];

    for (name, meaning, of) in columns {
        for (axis, word) in ["along", "up", "out"].into_iter().enumerate() {
            let cells: Vec<Option<f64>> = all.iter().map(|e| e.as_ref().and_then(|e| of(e, axis))).collect();
            table.push(
                &format!("{name}_{word}"),
                "m",
                &format!("{meaning}, {word}"),
                cells,
            )?;
        }
    }

    Ok(table)
}

fn page(design: &Design, places: &[[f64; 2]], all: &[Option<Expected>]) -> String {
    let mut page = Page::new("What the next survey will see");
    let [stones, measured] = design.stones;
    page.note(&format!(
        "If the survey {:?} is repeated with as many stations and points: {measured} of {stones} stones will be measured. \
         Registration: {}. Medians over these stones, millimetres, one standard deviation.",
        design.epoch, design.datum
    ));
    let number = |mm: Option<f64>| mm.map_or("\u{2013}".to_owned(), |mm| format!("{mm:.2}"));
    let row = |name: String, values: [Option<f64>; 3]| {
        std::iter::once(name)
            .chain(values.map(number))
            .collect::<Vec<_>>()
    };
    let rows = [
        row("motion".to_owned(), design.sd_mm),
        row("deformation".to_owned(), design.sd_deformation_mm),
        row(
            format!(
                "motion with {} instead of {} stations or strips",
                design.sources + 1,
                design.sources
            ),
            design.sd_with_one_more_mm,
        ),
        row(
            "motion without any error of registration".to_owned(),
            design.sd_without_registration_mm,
        ),
    ];

    page.html(&table(
        &["standard deviation, mm", "along", "up", "out"],
        &rows,
        None,
    ));
    let limits = design.zones_mm.iter().zip(design.zones_in_face_mm);
    let zones: Vec<Vec<String>> = { ZONE_EXTENTS_M.iter().zip(limits) }
        .map(|(extent, (out, in_face))| vec![format!("{extent} m"), number(*out), number(in_face)])
        .collect();
    page.heading("Smallest motion of a zone that is found in 95 of 100 cases")
        .html(&table(
            &["extent", "out of the wall, mm", "in the face, mm"],
            &zones,
            None,
        ));

    let bounds = |axis: usize| {
        let values = places.iter().map(|p| p[axis]);
        values.fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
    };
    let mut map = Plot::map(
        "large: standard deviation out of the wall above its median; grey: not measured",
        Axis::around("along the wall (m)", bounds(0), false),
        Axis::around("up the face (m)", bounds(1), false),
        900.0,
        None,
    );
    let limit = design.sd_mm[2].unwrap_or_default() * 1e-3;
    type Of = fn(Option<&Expected>, f64) -> bool;
    let kinds: [(&str, &str, f64, Of); 3] = [
        ("not measured", "#bbb", 3.0, |e, _| e.is_none()),
        ("at most the median", "#2c7fb8", 2.5, |e, limit| {
            e.is_some_and(|e| e.sd[2] <= limit)
        }),
        ("above the median", "#d95f0e", 4.0, |e, limit| {
            e.is_some_and(|e| e.sd[2] > limit)
        }),
    ];

    for (name, colour, radius_px, is_of) in kinds {
        let points: Vec<[f64; 2]> = places
            .iter()
            .zip(all)
            .filter(|(_, e)| is_of(e.as_ref(), limit))
            .map(|(place, _)| *place)
            .collect();
        map.add(Item::Dots {
            points,
            colour: colour.to_owned(),
            radius_px,
            name: name.to_owned(),
        });
    }

    page.heading("Stones").html(&map.svg());
    page.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_more_station_lessens_all_but_what_stations_share() {
        // Noise 1, registration 3 of which 1 is shared, two stations: 2/3 * (1 + 2) + 1.
        let e = expect([4.0; 3], [3.0; 3], 1.0, 2, [None; 3]);
        assert!((e.sd[0] - 2.0).abs() < 1e-12);
        assert!((e.one_more[1] - 3f64.sqrt()).abs() < 1e-12);
        assert!((e.without_registration[2] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn errors_of_stations_have_the_size_asked_for() {
        let errors: Vec<StationError> = (0..2000)
            .map(|k| StationError::draw(k, [2e-3, 1e-4], 5))
            .collect();
        let rms = |of: fn(&StationError) -> f64| {
            (errors.iter().map(|e| of(e).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
        };
        // Of 2,000 draws: standard error 1.6 %.
        assert!((rms(|e| e.shift.x) / 2e-3 - 1.0).abs() < 0.06);
        assert!((rms(|e| e.turn.z) / 1e-4 - 1.0).abs() < 0.06);
        assert_eq!(
            StationError::draw(1, [1.0; 2], 5).shift,
            StationError::draw(1, [1.0; 2], 5).shift
        );
        assert_ne!(
            StationError::draw(1, [1.0; 2], 5).shift,
            StationError::draw(1, [1.0; 2], 6).shift
        );
    }
}
