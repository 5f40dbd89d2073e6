//! How a simulated survey is made.

use super::event::Event;
use super::photos::PhotoErrors;
use super::points::{Points, SurveyPoint};
use super::wall::{Area, LEAST_SEEN, Truth, Wall};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::cell::LazyCell;
use stonewise_core::progress::Silent;
use stonewise_simulate::{
    FacePoint, Scan, SceneParams, SeenCells, Sensor, TlsParams, UavParams, WallMotion, WallParams, Window,
    World, scan_window, stone_truths,
};

/// What measures an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instrument {
    /// Scanner, with this many stations.
    Scanner(u32),
    /// Lidar under a drone, with this many strips.
    Drone(u32),
    /// Dense matching of photos whose principal points differ from photo to photo. `is_joint`: whether one bundle
    /// adjusts the photos of both epochs.
    Photos { is_joint: bool },
}

/// How a survey is made.
#[derive(Clone, Debug)]
pub struct Plan {
    pub instruments: [Instrument; 2],
    pub size_m: [f64; 2],
    pub motions: Vec<WallMotion>,
    pub events: Vec<Event>,
    /// What scanner and drone get wrong; the instruments say how many sources they have.
    pub tls: TlsParams,
    pub uav: UavParams,
    pub has_stable: bool,
}

impl Plan {
    /// A small wall and the usual errors of these instruments.
    pub fn usual(instruments: [Instrument; 2], motions: Vec<WallMotion>) -> Self {
        Self {
            instruments,
            size_m: [3.0, 2.0],
            motions,
            events: Vec::new(),
            tls: TlsParams {
                registration_m: 4e-4,
                datum_m: 3e-4,
                spacing_m: 0.007,
                ..TlsParams::default()
            },
            uav: UavParams {
                datum_m: 2e-3,
                drift_m: 3e-3,
                spacing_m: 0.012,
                ..UavParams::default()
            },
            has_stable: false,
        }
    }

    /// The survey of this plan. `seed`: of stones, motions and errors.
    pub fn make(&self, seed: u64) -> Wall {
        self.make_later(seed, 1)
    }

    /// The same whose second epoch is this one of a series, with errors of its own.
    pub fn make_later(&self, seed: u64, later: usize) -> Wall {
        let params = self.params().seeded(seed);
        let world = World::new(&params);
        let truths = stone_truths(&world, &Silent).unwrap();
        let scans = [0, 1].map(|epoch| {
            let sensor = match self.instruments[epoch] {
                Instrument::Drone(_) => Sensor::Uav,
                Instrument::Scanner(_) | Instrument::Photos { .. } => Sensor::Tls,
            };
            let number = epoch * later;
            scan_window(&world.scene(epoch), &params, sensor, number, &Window::whole()).unwrap()
        });
        let seen = [0, 1].map(|epoch| {
            let mut cells = SeenCells::new(&world, epoch);
            cells.add(&scans[epoch]);
            cells.shares(&truths)
        });
        let truth = truths.iter().enumerate().map(|(k, truth)| {
            let of_stone = Truth {
                normal: truth.normal,
                motion: world.motions[k].second_from_first,
                shared: truth.shared,
                is_loose: truth.loose,
                is_countable: !truth.edge && seen.iter().all(|s| s[k] >= LEAST_SEEN),
                is_odd: false,
            };
            (truth.id.0, of_stone)
        });
        let area = |motion: &WallMotion| {
            let (centre, largest_m) = match motion {
                WallMotion::Bulge {
                    centre_m, depth_m, ..
                } => (centre_m, depth_m.abs()),
                WallMotion::Zone { centre_m, d_m, .. } => (centre_m, Vector3::from(*d_m).norm()),
                _ => return None,
            };
            let [a, u] = *centre;
            let middle = world.wall.face.world_of(&FacePoint { a, u, n: 0.0 });
            Some(Area { middle, largest_m })
        };
        let is_joint = self.instruments == [Instrument::Photos { is_joint: true }; 2];
        let photos = LazyCell::new(|| PhotoErrors::new(is_joint, self.size_m, seed));
        let mut wall = Wall {
            epochs: [0, 1].map(|epoch| match self.instruments[epoch] {
                Instrument::Photos { .. } => photos.measured(&scans[epoch], epoch),
                _ => measured(&scans[epoch]),
            }),
            truth: truth.collect(),
            areas: self.motions.iter().filter_map(area).collect(),
            is_still_elsewhere: self.motions.iter().all(|m| {
                matches!(
                    m,
                    WallMotion::Bulge { .. } | WallMotion::Zone { .. } | WallMotion::Loose { .. }
                )
            }),
            is_still: self.motions.is_empty(),
            has_times: self.instruments.map(|i| !matches!(i, Instrument::Photos { .. })),
            has_stable: self.has_stable,
            network: matches!(self.instruments[1], Instrument::Photos { .. }).then(|| photos.network()),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xe7e7);
        for event in &self.events {
            event.happen(&mut wall, &mut rng);
        }
        wall
    }

    fn params(&self) -> SceneParams {
        let (mut tls, mut uav) = (None, None);
        for instrument in self.instruments {
            match instrument {
                Instrument::Drone(strips) => {
                    uav = Some(UavParams {
                        strips,
                        ..self.uav.clone()
                    })
                }
                Instrument::Scanner(stations) => {
                    tls = Some(TlsParams {
                        stations,
                        ..self.tls.clone()
                    })
                }
                Instrument::Photos { .. } => {
                    tls = Some(TlsParams {
                        stations: 3,
                        ..self.tls.clone()
                    })
                }
            }
        }
        SceneParams {
            wall: WallParams::sized(self.size_m),
            motions: self.motions.clone(),
            tls,
            uav,
            ..SceneParams::default()
        }
    }
}

/// The points of a scan by stone, as they were measured.
fn measured(scan: &Scan) -> Points {
    let mut points = Points::new();
    for (i, &stone) in scan.stone.iter().enumerate() {
        points.entry(stone).or_default().push(SurveyPoint {
            place: scan.cloud.world(i),
            source: scan.source[i] as usize,
            time_s: scan.time[i],
        });
    }
    points
}
