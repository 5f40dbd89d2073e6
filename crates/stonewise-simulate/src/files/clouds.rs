//! The clouds of one epoch, with the true stone of every point beside them.

use crate::files::SimulateError;
use crate::files::survey::{Survey, create_folder};
use crate::files::truth::SeenByScans;
use crate::world::{
    FacePoint, SampledFaces, Scan, SeenCells, Sensor, StoneTruth, Window, scan_window, stone_truths,
    window_truths,
};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;
use stonewise_io::cloud::{Dimension, ExtraColumn, ExtraType, Observed, PointSink, stream_scan_laz};

impl Survey<'_> {
    /// The clouds of both scanners, written unless they are there; gives back what they saw. `truths`: of all
    /// stones, filled in when they are first needed.
    pub fn scanned(&self, truths: &mut Option<Vec<StoneTruth>>) -> Result<SeenByScans, SimulateError> {
        let part = format!("epoch{}_clouds.json", self.number());
        if let Some(seen) = self.unfinished.read(&part) {
            if truths.is_none() {
                *truths = Some(stone_truths(self.world, self.progress)?);
            }
            return Ok(seen);
        }
        create_folder(&self.folder.join(format!("epoch{}", self.number())))?;
        let seen = self.write_clouds(truths)?;
        self.unfinished.write(&part, &seen)?;
        Ok(seen)
    }

    /// Scans the section piece by piece with both scanners into `cloud_SENSOR.laz`, and the same points in
    /// the same order, with the true stone of each, into the truth.
    fn write_clouds(&self, truths: &mut Option<Vec<StoneTruth>>) -> Result<SeenByScans, SimulateError> {
        let extent = self.world.wall.extent();
        let windows = Window::cover(extent);
        let mut seen = Sensor::ALL.map(|_| SeenCells::new(self.world, self.epoch));
        let (mut found, mut sampled) = (Vec::new(), SampledFaces::default());
        let mut total = 0;
        self.progress
            .begin(&format!("scans of epoch {}", self.number()), windows.len() as u64);
        self.with_files(Sensor::Tls, |tls| {
            self.with_files(Sensor::Uav, |uav| {
                let mut files = [tls, uav];
                for window in &windows {
                    self.progress.check()?;
                    let part = window.surroundings(extent);
                    let surface = self.world.next_surface(part, &mut sampled);
                    let scene = self.world.scene_of(&surface, self.epoch);
                    if self.epoch == 0 && truths.is_none() {
                        found.extend(window_truths(self.world, &scene, window));
                    }
                    for ((sensor, append), seen) in Sensor::ALL.into_iter().zip(&mut files).zip(&mut seen) {
                        let scan = scan_window(&scene, &self.params.scene, sensor, self.epoch, window);
                        if let (Some(scan), Some(append)) = (scan, append) {
                            seen.add(&scan);
                            total += scan.len();
                            append(&scan)?;
                        }
                    }
                    self.progress.advance(1);
                }
                Ok(())
            })
        })?;

        found.sort_by_key(|t: &StoneTruth| t.id);
        let truths = truths.get_or_insert(found);
        Ok(SeenByScans {
            total,
            points: seen.each_ref().map(|s| s.points().to_vec()),
            cells: seen.each_ref().map(|s| s.cells(truths)),
        })
    }

    /// Opens the files of a scanner's cloud and lends what appends to them, or `None` where the survey has no
    /// such scanner.
    fn with_files(
        &self,
        sensor: Sensor,
        write: impl FnOnce(Option<Append<'_>>) -> Result<(), SimulateError>,
    ) -> Result<(), SimulateError> {
        let wanted = match sensor {
            Sensor::Tls => self.params.scene.tls.is_some(),
            Sensor::Uav => self.params.scene.uav.is_some(),
        };
        if !wanted {
            return write(None);
        }
        let (name, number) = (sensor.name(), self.number());
        let path = self.folder.join(format!("epoch{number}/cloud_{name}.laz"));
        let truth = self
            .folder
            .join(format!("truth/epoch{number}_cloud_{name}_truth.laz"));
        let bounds = self.bounds();
        let stone = Dimension::new("stone_id", "", "stone, 0 for none");
        let columns = [(stone, ExtraType::U32)];
        stream_scan_laz(&path, &bounds, &[], |cloud| {
            stream_scan_laz(&truth, &bounds, &columns, |known| {
                write(Some(Box::new(|scan| append(cloud, known, scan))))
            })
        })
    }

    /// A box that holds all that scanners can measure.
    fn bounds(&self) -> Bounds {
        const AROUND_M: f64 = 3.0;
        let scene = &self.params.scene;
        let margins = [
            scene.tls.as_ref().map(|t| t.margin_m),
            scene.uav.as_ref().map(|u| u.margin_m),
        ];
        let margin = margins.iter().flatten().fold(0.0, |m: f64, v| m.max(*v));
        let [a0, a1, u0, u1] = self.world.wall.extent();
        let corners = (0..=64).flat_map(|i| {
            let a = a0 + (a1 - a0) * f64::from(i) / 64.0;
            [u0, u1].map(|u| self.world.wall.face.world_of(&FacePoint { a, u, n: 0.0 }))
        });
        let origin = Point3::origin();
        let around = Bounds::of(corners).unwrap_or(Bounds {
            min: origin,
            max: origin,
        });
        around.grown(margin + AROUND_M)
    }
}

/// Appends what was scanned to the files of a cloud.
type Append<'a> = Box<dyn FnMut(&Scan) -> Result<(), SimulateError> + 'a>;

fn append(cloud: &mut PointSink<'_>, known: &mut PointSink<'_>, scan: &Scan) -> Result<(), SimulateError> {
    let positions: Vec<Point3<f64>> = (0..scan.len()).map(|i| scan.cloud.world(i)).collect();
    // LAS numbers 65,535 sources at most; no survey has more stations.
    let sources: Vec<u16> = scan.source.iter().map(|s| *s as u16).collect();
    let observed = Observed {
        sources: &sources,
        times: &scan.time,
    };
    let (measured, truth) = rayon::join(
        || cloud.append_observed(&positions, observed, &[]),
        || known.append_observed(&positions, observed, &[ExtraColumn::U32(&scan.stone)]),
    );
    measured?;
    Ok(truth?)
}
