//! The stations and strips of an epoch: which points come from which, and when they were measured.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use stonewise_io::cloud::PointChunk;

/// What counts as one source of an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SourceRule {
    /// The file and the point source ID of LAS, or the scan of an E57, PTX or PTS; pieces of one strip in
    /// several files are joined.
    #[default]
    Auto,
    /// Each file.
    File,
    /// The whole epoch.
    None,
}

/// What the records of one file give one number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RawSource {
    /// Which of the epoch's clouds.
    file: usize,
    /// Point source ID, or number of the scan.
    number: u32,
    /// Points.
    pub points: u64,
    /// Time of its first point in the file, seconds; times in the tiles are relative to it.
    start_s: f64,
    /// Smallest and largest time, seconds; `None` without finite times.
    range_s: Option<[f64; 2]>,
}

/// Sources in the order in which the files show them.
#[derive(Clone, Debug, Default)]
pub struct SourceList {
    rule: SourceRule,
    list: Vec<RawSource>,
    at: BTreeMap<(usize, u32), u16>,
    /// The entry of the point before: mostly that of the next too.
    last: Option<((usize, u32), u16)>,
}

/// A source and a time relative to its start, for every point of a chunk.
pub type PointSource = (u16, f32);

impl SourceList {
    /// An empty list.
    pub fn new(rule: SourceRule) -> Self {
        Self {
            rule,
            ..Self::default()
        }
    }

    /// The source and time of each point of a chunk; new ones join the list.
    pub fn of_chunk(&mut self, file: usize, chunk: &PointChunk) -> Vec<PointSource> {
        (0..chunk.len())
            .map(|i| {
                let time = chunk.times_s.as_ref().map(|t| t[i]).filter(|t| t.is_finite());
                let number = match self.rule {
                    SourceRule::Auto => match (&chunk.sources, chunk.scan) {
                        (Some(sources), _) => u32::from(sources[i]),
                        (None, scan) => scan.unwrap_or(0) as u32,
                    },
                    SourceRule::File | SourceRule::None => 0,
                };
                let file = if self.rule == SourceRule::None { 0 } else { file };
                self.add(file, number, time)
            })
            .collect()
    }

    fn add(&mut self, file: usize, number: u32, time: Option<f64>) -> PointSource {
        let k = match self.last {
            Some((key, k)) if key == (file, number) => k,
            _ => {
                let next = self.list.len().min(usize::from(u16::MAX)) as u16;
                *self.at.entry((file, number)).or_insert(next)
            }
        };
        self.last = Some(((file, number), k));
        if usize::from(k) == self.list.len() {
            self.list.push(RawSource {
                file,
                number,
                points: 0,
                start_s: time.unwrap_or(0.0),
                range_s: None,
            });
        }
        let source = &mut self.list[usize::from(k)];
        source.points += 1;
        let Some(time) = time else { return (k, 0.0) };
        let [low, high] = source.range_s.unwrap_or([time; 2]);
        source.range_s = Some([low.min(time), high.max(time)]);
        (k, (time - source.start_s) as f32)
    }

    /// The list.
    pub fn finish(self) -> Vec<RawSource> {
        self.list
    }
}

/// A station or strip of an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochSource {
    /// How messages call it.
    pub name: String,
    /// Whether its points carry times.
    pub has_times: bool,
}

/// The sources of an epoch: of each number in the tiles, which source it is and where its clock starts.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochSources {
    /// In the order of their first points.
    pub list: Vec<EpochSource>,
    /// Number of sources that count as one, because they are too many to be compared with each other.
    pub too_many: Option<usize>,
    raw: Vec<(usize, f64)>,
}

/// Most sources that are compared with each other, a hundred: no survey has as many stations, but some files number
/// scan lines or points. Of their pieces in several files, the most.
const MOST_SOURCES: usize = 100;
const MOST_PIECES: usize = 10_000;

/// Pieces of one strip in neighbouring files follow each other within this time, seconds.
const SAME_PASS_S: f64 = 30.0;

impl EpochSources {
    /// Joins the pieces of one strip that lie in several files: the same number, and times that touch.
    pub fn new(raw: &[RawSource], clouds: &[PathBuf]) -> Self {
        if raw.len() > MOST_PIECES {
            return Self::as_one(raw, raw.len());
        }
        let mut of_raw: Vec<usize> = (0..raw.len()).collect();

        for k in 0..raw.len() {
            if let Some(j) = (0..k).find(|&j| is_same_pass(&raw[j], &raw[k])) {
                of_raw[k] = of_raw[j];
            }
        }

        let mut heads: Vec<usize> = of_raw.clone();
        heads.sort_unstable();
        heads.dedup();
        if heads.len() > MOST_SOURCES {
            return Self::as_one(raw, heads.len());
        }
        let list = heads.iter().map(|&h| {
            let source = &raw[h];
            let file = clouds.get(source.file).and_then(|p| p.file_name());
            EpochSource {
                name: format!("{}#{}", file.unwrap_or_default().to_string_lossy(), source.number),
                has_times: source.range_s.is_some_and(|[low, high]| high - low > 1e-3),
            }
        });

        let index = |head: usize| heads.binary_search(&head).unwrap_or(0);
        Self {
            list: list.collect(),
            too_many: None,
            raw: raw
                .iter()
                .zip(&of_raw)
                .map(|(r, &h)| (index(h), r.start_s))
                .collect(),
        }
    }

    /// All of them as one source.
    fn as_one(raw: &[RawSource], count: usize) -> Self {
        Self {
            list: vec![EpochSource {
                name: String::new(),
                has_times: false,
            }],
            too_many: Some(count),
            raw: raw.iter().map(|r| (0, r.start_s)).collect(),
        }
    }

    /// Source and time, seconds, of a point of the tiles.
    pub fn of(&self, number: u32, time: f32) -> (usize, f64) {
        match self.raw.get(number as usize) {
            Some((source, start_s)) => (*source, start_s + f64::from(time)),
            None => (0, 0.0),
        }
    }
}

fn is_same_pass(a: &RawSource, b: &RawSource) -> bool {
    let (Some(p), Some(q)) = (a.range_s, b.range_s) else {
        return false;
    };
    let gap = (p[0] - q[1]).max(q[0] - p[1]);
    a.file != b.file && a.number == b.number && q[1] > q[0] && p[1] > p[0] && gap < SAME_PASS_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn chunk(sources: &[u16], times: &[f64]) -> PointChunk {
        PointChunk {
            indices: (0..sources.len() as u64).collect(),
            positions: vec![Point3::origin(); sources.len()],
            sources: Some(sources.to_vec()),
            times_s: Some(times.to_vec()),
            ..PointChunk::default()
        }
    }

    #[test]
    fn numbers_of_scan_lines_are_no_stations() {
        let mut list = SourceList::new(SourceRule::Auto);
        let numbers: Vec<u16> = (0..1000).collect();
        list.of_chunk(0, &chunk(&numbers, &[0.0; 1000]));
        let sources = EpochSources::new(&list.finish(), &["a.laz".into()]);
        assert_eq!((sources.list.len(), sources.too_many), (1, Some(1000)));
        assert_eq!(sources.of(999, 2.0), (0, 2.0));
    }

    fn names(sources: &EpochSources) -> Vec<&str> {
        sources.list.iter().map(|s| s.name.as_str()).collect()
    }

    #[test]
    fn strips_in_tiled_files_are_joined_and_stations_in_files_of_their_own_are_not() {
        let clouds = ["a.laz", "b.laz"].map(PathBuf::from);
        let mut list = SourceList::new(SourceRule::Auto);
        let first = list.of_chunk(0, &chunk(&[1, 1, 2, 2], &[100.0, 109.0, 500.0, 505.0]));
        let second = list.of_chunk(1, &chunk(&[1, 1, 2], &[110.0, 120.0, 900.0]));
        assert_eq!(first[1], (0, 9.0));
        let sources = EpochSources::new(&list.finish(), &clouds);
        // Strip 1 goes on in the second file ten seconds later; what is called 2 there is another pass.
        assert_eq!(names(&sources), ["a.laz#1", "a.laz#2", "b.laz#2"]);
        assert_eq!(sources.of(second[1].0.into(), second[1].1), (0, 120.0));
        assert_eq!(sources.of(second[2].0.into(), second[2].1), (2, 900.0));
        assert!(sources.list[0].has_times && !sources.list[2].has_times);
    }

    #[test]
    fn rules_make_files_or_the_whole_epoch_one_source() {
        let clouds = ["a.laz", "b.laz"].map(PathBuf::from);
        for (rule, expected) in [
            (SourceRule::File, vec!["a.laz#0", "b.laz#0"]),
            (SourceRule::None, vec!["a.laz#0"]),
        ] {
            let mut list = SourceList::new(rule);
            list.of_chunk(0, &chunk(&[1, 2], &[0.0, 0.0]));
            list.of_chunk(1, &chunk(&[1, 2], &[0.0, 0.0]));
            assert_eq!(names(&EpochSources::new(&list.finish(), &clouds)), expected);
        }
    }
}
