//! Surveys that lie beside the checkout: labels and matches are read, no detector is run.

use super::event::Event;
use super::points::{Points, SurveyPoint, mean};
use super::wall::{LEAST_SEEN, Truth, Wall};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise::results::names::epoch_dir;
use stonewise_core::geometry::Rigid3;
use stonewise_io::table::{CsvFile, CsvRow};

/// A survey on disk.
pub enum Stored {
    /// The simulated section of another simulator, by its true labels; the sensors of both epochs.
    Dam {
        is_moved: bool,
        sensors: [&'static str; 2],
        events: Vec<Event>,
        has_stable: bool,
    },
    /// A real wall that stood still, by the results of a run; its outside. `is_moved`: the second epoch is moved by 2 cm
    /// along and 5 cm up, as in the paper.
    Real {
        name: &'static str,
        outward: [f64; 2],
        is_moved: bool,
    },
}

impl Stored {
    /// All of them by name, and whether `quick` has them.
    pub fn all() -> Vec<(String, Self, bool)> {
        let mut list = Vec::new();
        for (by, sensors) in [
            ("tls", ["tls", "tls"]),
            ("uav", ["uav", "uav"]),
            ("tls_uav", ["tls", "uav"]),
            ("uav_tls", ["uav", "tls"]),
        ] {
            let mut add = |happened: &str, is_moved, events, has_stable| {
                let is_quick = is_moved && sensors[0] == sensors[1];
                let dam = Self::Dam {
                    is_moved,
                    sensors,
                    events,
                    has_stable,
                };
                list.push((format!("dam_{by}-{happened}"), dam, is_quick));
            };
            add("combo", true, Vec::new(), false);
            add("combo-masks", true, vec![Event::Masks], false);
            add("combo-stable", true, Vec::new(), true);
            add("still", false, Vec::new(), false);
        }
        // Outsides as the surveys' own descriptions have them.
        for (name, outward) in [
            ("fountain", [0.297_93, -0.954_56]),
            ("portal", [-0.906_31, -0.422_62]),
            ("corner", [-0.342_02, -0.939_69]),
        ] {
            for (happened, is_moved) in [("still", false), ("moved", true)] {
                let real = Self::Real {
                    name,
                    outward,
                    is_moved,
                };
                list.push((format!("{name}-{happened}"), real, !is_moved));
            }
        }
        list
    }

    /// Reads it; the reason where it is not there. `results`: folder with the results of each real survey by name.
    pub fn read(&self, results: Option<&str>) -> Result<Wall, String> {
        match self {
            Self::Dam {
                is_moved,
                sensors,
                events,
                has_stable,
            } => {
                let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/dam_small");
                let part = if *is_moved { "combo" } else { "split" };
                let folder = Path::new(data).join(part).join("truth");
                let mut wall = dam(&folder, *sensors, *is_moved)?;
                wall.has_stable = *has_stable;
                for event in events {
                    event.happen(&mut wall, &mut ChaCha8Rng::seed_from_u64(1));
                }
                Ok(wall)
            }
            Self::Real {
                name,
                outward,
                is_moved,
            } => {
                let results = results.ok_or("no results of a run: give them with --results FOLDER")?;
                real(&Path::new(results).join(name), *outward, *is_moved)
            }
        }
    }
}

fn dam(folder: &Path, sensors: [&str; 2], is_moved: bool) -> Result<Wall, String> {
    let cloud = |epoch: usize| {
        let name = format!("epoch{}_cloud_{}_truth.laz", epoch + 1, sensors[epoch]);
        // The stone is the first further dimension of these files.
        points(&folder.join(name), |bytes| bytes)
    };
    let epochs = [cloud(0)?, cloud(1)?];
    let mut truth = BTreeMap::new();
    for row in table(&folder.join("stones.csv"))? {
        let number = |name: &str| row[name].parse::<f64>().unwrap_or(f64::NAN);
        let vector = |names: [&str; 3]| Vector3::from(names.map(number));
        let [centre, moved, shared, turn] = [
            ["cx", "cy", "cz"],
            ["dx", "dy", "dz"],
            ["bgx", "bgy", "bgz"],
            ["rx", "ry", "rz"],
        ]
        .map(vector);
        let turned = Rigid3::rotation_wrt_point(UnitQuaternion::new(turn), centre.into());
        let of_stone = Truth {
            normal: vector(["nx", "ny", "nz"]),
            motion: match is_moved {
                true => Rigid3::from(Translation3::from(moved)) * turned,
                false => Rigid3::identity(),
            },
            shared: if is_moved { shared } else { Vector3::zeros() },
            is_loose: is_moved && number("loose") > 0.5,
            is_countable: sensors.iter().all(|s| number(&format!("vis_{s}")) >= LEAST_SEEN)
                && number("edge") < 0.5,
            is_odd: false,
        };
        truth.insert(number("stone_id") as u32, of_stone);
    }
    Ok(Wall {
        epochs,
        truth,
        is_still: !is_moved,
        is_still_elsewhere: !is_moved,
        has_times: [true; 2],
        ..Wall::default()
    })
}

fn real(results: &Path, [x, y]: [f64; 2], is_moved: bool) -> Result<Wall, String> {
    let partners: BTreeMap<u32, u32> = table(&results.join("stones.csv"))?
        .iter()
        .filter_map(|row| Some((row["matched_id"].parse().ok()?, row["stone_id"].parse().ok()?)))
        .collect();
    // Labels are the last of an epoch's further dimensions; in the first, motions follow them.
    let labelled = |epoch: usize, after: usize| -> Result<Points, String> {
        let folder = results.join(epoch_dir(epoch));
        let mut all = Points::new();
        for file in files(&folder)? {
            for (id, mut own) in points(&file, |bytes| &bytes[bytes.len() - after..])? {
                all.entry(id).or_default().append(&mut own);
            }
        }
        Ok(all)
    };
    let (first, second) = (labelled(1, 18)?, labelled(2, 4)?);
    let motion = match is_moved {
        true => Translation3::new(-0.02 * y, 0.02 * x, 0.05).into(),
        false => Rigid3::identity(),
    };
    let mut moved = Points::new();
    for (id, own) in second {
        let place = |p: SurveyPoint| SurveyPoint {
            place: motion * p.place,
            ..p
        };
        let id = partners.get(&id).copied().unwrap_or(0);
        moved.entry(id).or_default().extend(own.into_iter().map(place));
    }
    let of_stone = |(id, own): (&u32, &Vec<SurveyPoint>)| {
        let truth = Truth {
            normal: Vector3::new(x, y, 0.0),
            motion,
            shared: motion * mean(own) - mean(own),
            is_loose: false,
            is_countable: moved.contains_key(id),
            is_odd: false,
        };
        (*id, truth)
    };
    Ok(Wall {
        truth: first.iter().filter(|(id, _)| **id > 0).map(of_stone).collect(),
        epochs: [first, moved],
        is_still: !is_moved,
        is_still_elsewhere: !is_moved,
        ..Wall::default()
    })
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let list = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files: Vec<PathBuf> = list.filter_map(|f| Some(f.ok()?.path())).collect();
    files.sort();
    Ok(files)
}

/// The points of a cloud by the stone that its further dimensions name. `label`: the bytes that begin with it.
fn points(path: &Path, label: impl Fn(&[u8]) -> &[u8]) -> Result<Points, String> {
    let failed = |e: las::Error| format!("{}: {e}", path.display());
    let data = las::Reader::from_path(path)
        .and_then(|mut r| r.read_all())
        .map_err(failed)?;
    let mut points = Points::new();
    for point in data.points() {
        let point = point.map_err(failed)?;
        let label: [u8; 4] = label(&point.extra_bytes)[..4].try_into().unwrap_or_default();
        points
            .entry(u32::from_le_bytes(label))
            .or_default()
            .push(SurveyPoint {
                place: Point3::new(point.x, point.y, point.z),
                source: usize::from(point.point_source_id),
                time_s: point.gps_time.unwrap_or(0.0),
            });
    }
    Ok(points)
}

/// The rows of a CSV file, by column.
fn table(path: &Path) -> Result<Vec<BTreeMap<String, String>>, String> {
    let bytes = fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let file = CsvFile::parse(path, bytes).map_err(|e| e.to_string())?;
    let cells = |row: CsvRow<'_>| {
        let head = file.head().iter().enumerate();
        head.map(|(i, name)| (name.clone(), row.text(i).to_owned()))
            .collect()
    };
    let rows = file.rows().map(|row| row.map(cells).map_err(|e| e.to_string()));
    rows.collect()
}
