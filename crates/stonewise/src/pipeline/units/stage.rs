//! The units of a project: what each is, what it needs, and what it will take.

use crate::error::Result;
use crate::pipeline::steps::label::batches::{PREPARE, batch_name};
use crate::pipeline::steps::segment::{part_name, photos_to_segment};
use crate::pipeline::units::receipt::receipt_file;
use crate::project::{Epoch, Project};
use crate::storage::tiles::most_records;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use stonewise_segment::Weights;

/// What a unit does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Cuts the clouds of an epoch into tiles.
    Ingest,
    /// Finds the stones of one photo.
    SegmentPhoto,
    /// Gathers the photos of an epoch, or brings its masks into label images.
    Segment,
    /// Makes the depth maps of an epoch's photos and decides about their instances.
    LabelPrepare,
    /// Labels the points of a batch of tiles.
    LabelTiles,
    /// Gathers the labels of an epoch.
    Label,
    /// Tabulates the stones of an epoch.
    Stones,
    /// Draws the outlines of the first epoch's stones.
    Outlines,
    /// Finds the stones of the first epoch in a later one.
    Match,
    /// Compares labels with the relief of the clouds.
    Offsets,
    /// Measures the matched stones of a later epoch.
    Register,
    /// Compares the clouds of a later epoch with a batch of tiles of the first, along normals.
    M3c2Tiles,
    /// Gathers that comparison.
    M3c2,
    /// Writes the clouds of an epoch with the stone of every point.
    Clouds,
    /// Writes tables, verdict and report.
    Report,
}

/// A unit of work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Its name: that of the step, with `.PART` where it is a part of one.
    pub id: String,
    /// What it does.
    pub stage: Stage,
    /// The epoch that it is about, from 1; of a pair of epochs the later one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch: Option<usize>,
    /// Which part of the step, from 0: a photo or a batch of tiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<usize>,
    /// How many parts of its kind the step has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<usize>,
    /// Units that come first. Units of one rank do not need each other, and only ones of lower ranks.
    pub rank: usize,
    /// The units that it needs; what these need is left out.
    pub needs: Vec<String>,
    /// Files that must be there: of the survey, and, relative to the results folder, the outputs of the units
    /// that it needs.
    pub inputs: Vec<PathBuf>,
    /// The file, relative to the results folder, that says it is done.
    pub output: PathBuf,
    /// Threads that it makes good use of; it works with any number.
    pub cores: u32,
    /// Memory that it may take, bytes: estimated from the numbers of points and pixels.
    pub memory_bytes: u64,
    /// Whether it was done when the plan was made.
    pub done: bool,
}

/// Memory of any unit before it has read anything, bytes: the program, its threads, buffers of files.
const BASE_BYTES: u64 = 512 << 20;
/// Memory of the step `register` for each point of both epochs, bytes: 4.1 to 5.1 GB were measured for 67
/// million.
const REGISTER_BYTES: u64 = 80;
/// Memory of other steps that go through a cloud, for each of its points, bytes: the labels of the points of
/// a file while it is written, the cells that are covered while stones are matched.
const POINT_BYTES: u64 = 16;
/// Memory of the detector for each pixel of a photo, bytes: the photo as numbers at two sizes, and a tile a
/// thread.
const PIXEL_BYTES: u64 = 100;

/// All units of a project, each after those that it needs; `batch_points`: points of a cloud in a batch of
/// tiles, about.
pub(super) fn units_of(project: &Project, batch_points: u64) -> Result<Vec<Unit>> {
    let mut list = List::default();
    let points = project
        .epochs
        .iter()
        .map(|e| points_of(&e.clouds))
        .collect::<Result<Vec<u64>>>()?;
    let takes_relief = Weights::named(&project.settings.segment.model).takes_relief();
    let depth_maps = u64::from(project.settings.label.depth_memory_mib) << 20;
    for (n, epoch) in (1..).zip(&project.epochs) {
        let of_cloud = POINT_BYTES * points[n - 1];
        // Tiles are sorted in a buffer of a quarter of a gibibyte.
        let ingest = Work::of(&[], 2, 256 << 20);
        list.add(Stage::Ingest, n, ingest.reading(&epoch.clouds));
        list.add_photos(n, epoch, matches!(takes_relief, Ok(true)))?;
        list.add_labels(n, batches_of(points[n - 1], batch_points), depth_maps, of_cloud);
        list.add(Stage::Stones, n, Work::of(&[format!("label-{n}")], 1, of_cloud));
    }
    // Corrections by hand look at the stones of all epochs.
    let stones: Vec<String> = (1..=project.epochs.len())
        .map(|n| format!("stones-{n}"))
        .collect();
    let outlines = Work::of(&stones, 1, 2 * POINT_BYTES * points[0]);
    list.push("outlines".to_owned(), Stage::Outlines, None, outlines);
    for n in 2..=project.epochs.len() {
        list.add_pair(project, n, [points[0], points[n - 1]], batch_points);
    }
    for n in 1..=project.epochs.len() {
        let needs = match n {
            1 => "register-2".to_owned(),
            _ => "outlines".to_owned(),
        };
        list.add(
            Stage::Clouds,
            n,
            Work::of(&[needs], 1, POINT_BYTES * points[n - 1]),
        );
    }
    let rest = list.not_needed();
    let report = Work::of(&rest, 2, POINT_BYTES * points.iter().sum::<u64>());
    list.push("report".to_owned(), Stage::Report, None, report);
    Ok(list.units)
}

/// What a unit needs.
#[derive(Clone, Copy)]
struct Work<'a> {
    /// Units that come first.
    needs: &'a [String],
    cores: u32,
    /// Memory beyond that at rest.
    bytes: u64,
    /// Files of the survey that it reads.
    inputs: &'a [PathBuf],
}

impl<'a> Work<'a> {
    /// A unit that reads no file of the survey.
    fn of(needs: &'a [String], cores: u32, bytes: u64) -> Self {
        Self {
            needs,
            cores,
            bytes,
            inputs: &[],
        }
    }

    /// The same, reading these files.
    fn reading(self, inputs: &'a [PathBuf]) -> Self {
        Self { inputs, ..self }
    }
}

/// Units as they are added.
#[derive(Default)]
struct List {
    units: Vec<Unit>,
    ranks: BTreeMap<String, usize>,
}

impl List {
    fn add(&mut self, stage: Stage, epoch: usize, work: Work) {
        self.push(format!("{}-{epoch}", stage.step()), stage, Some(epoch), work);
    }

    fn push(&mut self, id: String, stage: Stage, epoch: Option<usize>, work: Work) {
        let outputs = work.needs.iter().map(|id| receipt_file(id));
        let ranks = work.needs.iter().filter_map(|id| self.ranks.get(id));
        let rank = ranks.max().map_or(0, |rank| rank + 1);
        self.ranks.insert(id.clone(), rank);
        self.units.push(Unit {
            stage,
            epoch,
            part: None,
            parts: None,
            rank,
            needs: work.needs.to_vec(),
            inputs: work.inputs.iter().cloned().chain(outputs).collect(),
            output: receipt_file(&id),
            cores: work.cores,
            memory_bytes: BASE_BYTES + work.bytes,
            done: false,
            id,
        });
    }

    /// The photos of an epoch, one by one where the detector looks at them, and the step that gathers them.
    fn add_photos(&mut self, n: usize, epoch: &Epoch, takes_relief: bool) -> Result<()> {
        let bytes = PIXEL_BYTES * most_pixels(epoch)?;
        let mut photos = Vec::new();
        let count = photos_to_segment(epoch)?;
        for photo in 0..count {
            let id = format!("segment-{n}.{}", part_name(photo));
            let inputs = [epoch.cameras.clone(), epoch.images.clone()];
            // A detector that takes relief looks at the clouds, too.
            let needs = takes_relief.then(|| format!("ingest-{n}"));
            let work = Work::of(needs.as_slice(), 4, bytes).reading(&inputs);
            self.push(id.clone(), Stage::SegmentPhoto, Some(n), work);
            self.last(|unit| (unit.part, unit.parts) = (Some(photo), Some(count)));
            photos.push(id);
        }
        let inputs = [epoch.cameras.clone()].into_iter().chain(epoch.masks.clone());
        let inputs: Vec<PathBuf> = inputs.collect();
        self.add(Stage::Segment, n, Work::of(&photos, 2, bytes).reading(&inputs));
        Ok(())
    }

    /// A later epoch against the first; `points`: of both.
    fn add_pair(&mut self, project: &Project, n: usize, points: [u64; 2], batch_points: u64) {
        let both = points[0] + points[1];
        let photos: Vec<PathBuf> = match project.settings.registration.photos.enabled {
            true => [0, n - 1].map(|e| project.epochs[e].images.clone()).into(),
            false => Vec::new(),
        };
        let (outlines, matched) = (["outlines".to_owned()], [format!("match-{n}")]);
        self.add(Stage::Match, n, Work::of(&outlines, 1, POINT_BYTES * both));
        self.add(Stage::Offsets, n, Work::of(&matched, 2, 0));
        let register = Work::of(&matched, 8, REGISTER_BYTES * both);
        self.add(Stage::Register, n, register.reading(&photos));
        let clouds = [
            "ingest-1".to_owned(),
            format!("ingest-{n}"),
            "segment-1".to_owned(),
        ];
        let batches = batches_of(points[0], batch_points);
        self.add_batches(Stage::M3c2Tiles, n, batches, &clouds, 512 << 20);
        self.finish_batches(Stage::M3c2, n, POINT_BYTES * points[0]);
    }

    /// Labels of an epoch: what all batches need, the batches, and the whole.
    fn add_labels(&mut self, n: usize, batches: usize, depth_maps: u64, of_cloud: u64) {
        let needs = [format!("ingest-{n}"), format!("segment-{n}")];
        let prepare = format!("label-{n}.{PREPARE}");
        let bytes = depth_maps + of_cloud / 4;
        self.push(
            prepare.clone(),
            Stage::LabelPrepare,
            Some(n),
            Work::of(&needs, 4, bytes),
        );
        self.add_batches(Stage::LabelTiles, n, batches, &[prepare], bytes);
        self.finish_batches(Stage::Label, n, of_cloud);
    }

    /// One unit for each batch of tiles.
    fn add_batches(&mut self, stage: Stage, n: usize, batches: usize, needs: &[String], bytes: u64) {
        for batch in 0..batches {
            let id = format!("{}-{n}.{}", stage.step(), batch_name(batch, batches));
            self.push(id, stage, Some(n), Work::of(needs, 4, bytes));
            self.last(|unit| (unit.part, unit.parts) = (Some(batch), Some(batches)));
        }
    }

    /// The step that gathers the batches that were added last.
    fn finish_batches(&mut self, stage: Stage, n: usize, bytes: u64) {
        let parts = self.units.last().and_then(|u| u.parts).unwrap_or(1);
        let batches = &self.units[self.units.len() - parts..];
        let needs: Vec<String> = batches.iter().map(|u| u.id.clone()).collect();
        self.add(stage, n, Work::of(&needs, 1, bytes));
        self.last(|unit| unit.parts = Some(parts));
    }

    fn last(&mut self, change: impl FnOnce(&mut Unit)) {
        if let Some(unit) = self.units.last_mut() {
            change(unit);
        }
    }

    /// Units that no other needs.
    fn not_needed(&self) -> Vec<String> {
        let is_needed = |id: &String| self.units.iter().any(|u| u.needs.contains(id));
        let ids = self.units.iter().map(|u| &u.id);
        ids.filter(|id| !is_needed(id)).cloned().collect()
    }
}

impl Stage {
    /// The name of the step, without the epoch's number.
    fn step(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::SegmentPhoto | Self::Segment => "segment",
            Self::LabelPrepare | Self::LabelTiles | Self::Label => "label",
            Self::Stones => "stones",
            Self::Outlines => "outlines",
            Self::Match => "match",
            Self::Offsets => "offsets",
            Self::Register => "register",
            Self::M3c2Tiles | Self::M3c2 => "m3c2",
            Self::Clouds => "clouds",
            Self::Report => "report",
        }
    }
}

/// Batches of tiles for a cloud of so many points; names have three digits.
fn batches_of(points: u64, batch_points: u64) -> usize {
    points.div_ceil(batch_points.max(1)).clamp(1, 999) as usize
}

/// Points that the clouds of an epoch say they hold; of files that do not say so, as many as fit in their
/// length.
fn points_of(clouds: &[PathBuf]) -> Result<u64> {
    clouds.iter().map(|cloud| most_records(cloud)).sum()
}

fn most_pixels(epoch: &Epoch) -> Result<u64> {
    let cameras = epoch.read_cameras()?;
    let pixels = cameras
        .views
        .iter()
        .map(|v| u64::from(v.camera.width) * u64::from(v.camera.height));
    Ok(pixels.max().unwrap_or(0))
}
