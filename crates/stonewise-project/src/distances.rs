//! Known lengths, each an observation of the scale of an epoch.

use crate::instruments::InstrumentFile;
use crate::networks::NetworkFile;
use crate::project_type::{Distance, Epoch};
use nalgebra::Point3;
use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_core::epoch::EpochId;
use stonewise_io::table::{CsvError, CsvFile, CsvRow};

/// A length of the cloud that differs from the known one by more than this share has the wrong ends or unit.
const LARGEST_SHARE: f64 = 0.2;

/// The table `[[distances]]`, or `[distances]` with a file.
#[derive(JsonSchema)]
#[schemars(untagged)]
pub(crate) enum RawDistances {
    /// Each length with its ends.
    Tables(Vec<RawDistance>),
    /// A file of them.
    File(RawFile),
}

/// A CSV file of known lengths.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawFile {
    /// A CSV file with the columns from, to, length_m, sd_m, epoch; an end is three numbers with spaces between them, or
    /// the name of a target.
    file: PathBuf,
}

/// A known length.
#[derive(Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDistance {
    /// One end: a point of the cloud, metres, or the name of a target of `[[instruments]]`.
    from: End,
    /// The other end.
    to: End,
    /// The length, metres.
    #[schemars(range(min = 0))]
    length_m: f64,
    /// Its standard deviation, metres.
    #[schemars(range(min = 0))]
    sd_m: f64,
    /// Name of the epoch whose cloud shows it.
    epoch: String,
}

#[derive(Clone, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "an end is three numbers, or the name of a target")]
enum End {
    Place([f64; 3]),
    Target(String),
}

/// Reads the table or the tables, so that an error says what is wrong in them.
pub(crate) fn read_raw<'de, D: Deserializer<'de>>(
    from: D,
) -> std::result::Result<Option<RawDistances>, D::Error> {
    let said = |e: toml::de::Error| D::Error::custom(e.message());
    match toml::Value::deserialize(from)? {
        table @ toml::Value::Table(_) => table.try_into().map(RawDistances::File).map_err(said).map(Some),
        tables => tables
            .try_into()
            .map(RawDistances::Tables)
            .map_err(said)
            .map(Some),
    }
}

/// Places by name.
pub(crate) type Targets<'a> = BTreeMap<&'a str, Point3<f64>>;

/// Where other instruments are; of two of one name, the first.
pub(crate) fn targets<'a>(instruments: &'a [InstrumentFile], networks: &'a [NetworkFile]) -> Targets<'a> {
    let instruments = instruments.iter().flat_map(|file| &file.instruments);
    let points = networks.iter().flat_map(|n| &n.network.points);
    let instruments = instruments.map(|i| (i.name.as_str(), i.place));
    let mut targets = Targets::new();
    for (name, place) in instruments.chain(points.map(|p| (p.name.as_str(), p.place))) {
        targets.entry(name).or_insert(place);
    }
    targets
}

/// The lengths of a project, whose file is at `project`. `line`: of a table by its number, or of the one that names a file.
///
/// # Errors
/// With the file and the line: a file that is not there or no such table, an epoch or target that is not known, a length
/// that cannot be.
pub(crate) fn distances(
    raw: RawDistances,
    project: &Path,
    line: impl Fn(Option<usize>) -> usize,
    epochs: &[Epoch],
    targets: &Targets,
) -> Result<Vec<Distance>> {
    let find = |raw: &RawDistance, stated: (PathBuf, usize)| {
        raw.find(epochs, targets)
            .map_err(|message| Error::Project {
                path: stated.0.clone(),
                line: stated.1,
                message,
            })
            .map(|distance| Distance { stated, ..distance })
    };
    match raw {
        RawDistances::Tables(tables) => {
            let tables = tables.iter().enumerate();
            tables
                .map(|(k, raw)| find(raw, (project.to_path_buf(), line(Some(k)))))
                .collect()
        }
        RawDistances::File(file) => {
            let path = project.parent().unwrap_or(Path::new("")).join(&file.file);
            let bytes = fs::read(&path).map_err(|e| Error::Project {
                path: project.to_path_buf(),
                line: line(None),
                message: format!("{}: {e} (paths are relative to the project file)", path.display()),
            })?;
            let in_table = |e: CsvError| Error::Project {
                path: e.path.clone(),
                line: e.line,
                message: e.said(),
            };
            let table = CsvFile::parse(&path, bytes).map_err(in_table)?;
            let rows = table.rows().map(|row| {
                let row = row.map_err(in_table)?;
                let raw = RawDistance::of(&table, &row).map_err(in_table)?;
                find(&raw, (path.clone(), row.line()))
            });
            rows.collect()
        }
    }
}

impl RawDistance {
    fn of(table: &CsvFile, row: &CsvRow) -> std::result::Result<Self, CsvError> {
        let column = |name: &str| {
            let missing = || {
                table.error(
                    1,
                    format!("no column {name}: from, to, length_m, sd_m and epoch are needed"),
                )
            };
            table.column(name).ok_or_else(missing)
        };
        let number = |name: &str| {
            let column = column(name)?;
            row.number(column)?
                .ok_or_else(|| row.error_in(column, "a number is missing"))
        };
        let end = |name: &str| {
            let text = row.text(column(name)?);
            let numbers: Vec<f64> = text
                .split_whitespace()
                .map_while(|part| part.parse().ok())
                .collect();
            Ok(match <[f64; 3]>::try_from(numbers) {
                Ok(place) => End::Place(place),
                Err(_) => End::Target(text.to_owned()),
            })
        };
        Ok(Self {
            from: end("from")?,
            to: end("to")?,
            length_m: number("length_m")?,
            sd_m: number("sd_m")?,
            epoch: row.text(column("epoch")?).to_owned(),
        })
    }

    /// The length with its epoch and ends, or what is wrong with it.
    fn find(&self, epochs: &[Epoch], targets: &Targets) -> std::result::Result<Distance, String> {
        let Some(epoch) = epochs.iter().position(|e| e.name == self.epoch) else {
            let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
            return Err(format!("epoch must name an epoch: {}", names.join(", ")));
        };
        if !(self.length_m.is_finite() && self.length_m > 0.0) {
            return Err("length_m must be a number above 0".to_owned());
        }
        if !(self.sd_m.is_finite() && self.sd_m >= 0.0) {
            return Err("sd_m must be a number, 0 or more".to_owned());
        }
        let ends = [self.from.place(targets)?, self.to.place(targets)?];
        let found_m = (ends[1] - ends[0]).norm();
        if (found_m / self.length_m - 1.0).abs() > LARGEST_SHARE {
            return Err(format!(
                "the ends lie {found_m:.3} m apart, and the length is {} m: check the ends and the units",
                self.length_m
            ));
        }
        Ok(Distance {
            epoch: EpochId::at(epoch),
            ends,
            length_m: self.length_m,
            sd_m: self.sd_m,
            stated: (PathBuf::new(), 0),
        })
    }
}

impl End {
    fn place(&self, targets: &Targets) -> std::result::Result<Point3<f64>, String> {
        match self {
            Self::Place(place) if place.iter().all(|v| v.is_finite()) => Ok(Point3::from(*place)),
            Self::Place(_) => Err("the coordinates of an end must be finite".to_owned()),
            Self::Target(name) => targets.get(name.as_str()).copied().ok_or_else(|| {
                let names: Vec<&str> = targets.keys().copied().collect();
                match names.is_empty() {
                    true => {
                        format!("{name:?} is no target: give three coordinates, or add [[instruments]]")
                    }
                    false => format!("{name:?} is no target; there are {}", names.join(", ")),
                }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Project;
    use nalgebra::Point3;
    use std::fs;
    use stonewise_base::error::Result;

    const TARGETS: &str = "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-02,0,0.001\n";

    /// The project of two clouds with these tables at its end, and this file of distances.
    fn read(tables: &str, file: &str) -> Result<Project> {
        let dir = tempfile::tempdir().unwrap();
        let text = format!(
            "[project]\nname = \"wall\"\nreference = \"b\"\n[[epochs]]\nname = \"a\"\nclouds = [\"a.laz\"]\n\
             [[epochs]]\nname = \"b\"\nclouds = [\"b.laz\"]\n[[instruments]]\nfile = \"targets.csv\"\n{tables}"
        );
        let files = [
            ("a.laz", ""),
            ("b.laz", ""),
            ("targets.csv", TARGETS),
            ("lengths.csv", file),
        ];
        files
            .into_iter()
            .for_each(|(name, text)| fs::write(dir.path().join(name), text).unwrap());
        let path = dir.path().join("stonewise.toml");
        fs::write(&path, text).unwrap();
        Project::read(&path)
    }

    #[test]
    fn lengths_are_read_from_tables_and_from_a_file() {
        let table = "[[distances]]\nfrom = \"T1\"\nto = [1.0, 2.0, 13]\nlength_m = 10.01\nsd_m = 0.001\nepoch = \"a\"\n";
        let file = "from;to;length_m;sd_m;epoch\nT1;1 2 13,0;10,01;0,001;a\n".replace("13,0", "13.0");
        for project in [
            read(table, ""),
            read("[distances]\nfile = \"lengths.csv\"\n", &file),
        ] {
            let project = project.unwrap();
            let [distance] = project.distances.as_slice() else {
                panic!("{:?}", project.distances)
            };
            assert_eq!(
                distance.ends,
                [Point3::new(1.0, 2.0, 3.0), Point3::new(1.0, 2.0, 13.0)]
            );
            assert_eq!((distance.length_m, distance.sd_m), (10.01, 0.001));
            // The reference comes first, so that epoch a is the later one.
            assert_eq!(project.epochs[distance.epoch].name, "a");
        }
    }

    #[test]
    fn lengths_that_cannot_be_are_refused_with_their_line() {
        let table = |change: [&str; 2]| {
            let table = "[[distances]]\nfrom = \"T1\"\nto = [1.0, 2.0, 13.0]\nlength_m = 10.01\nsd_m = 0.001\nepoch = \"a\"\n";
            read(&table.replace(change[0], change[1]), "")
                .unwrap_err()
                .to_string()
        };
        for (change, message) in [
            (
                ["\"T1\"", "\"T2\""],
                "stonewise.toml:12: \"T2\" is no target; there are T1",
            ),
            (
                ["10.01", "32.8"],
                "stonewise.toml:12: the ends lie 10.000 m apart",
            ),
            (["0.001", "-0.001"], "stonewise.toml:12: sd_m must be"),
            (["\"a\"", "\"c\""], "epoch must name an epoch: b, a"),
            (
                ["[1.0, 2.0, 13.0]", "[1.0]"],
                "an end is three numbers, or the name of a target",
            ),
            (["sd_m", "sd"], "unknown field `sd`"),
        ] {
            let found = table(change);
            assert!(found.contains(message), "{found}");
        }
        let file = |text: &str| {
            read("[distances]\nfile = \"lengths.csv\"\n", text)
                .unwrap_err()
                .to_string()
        };
        let found = file("from,to,length_m,sd_m,epoch\n1 2 3,1 2 13,10.0,,a\n");
        assert!(
            found.contains("lengths.csv:2: ") && found.contains("sd_m"),
            "{found}"
        );
        assert!(file("from,to\n1 2 3,1 2 13\n").contains("no column length_m"));
        let found = read("[distances]\nfile = \"none.csv\"\n", "")
            .unwrap_err()
            .to_string();
        assert!(found.contains("none.csv"), "{found}");
    }
}
