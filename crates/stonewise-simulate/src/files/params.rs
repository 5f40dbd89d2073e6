//! Everything about a simulated survey.

use crate::files::SimulateError;
use crate::world::{
    PhotoParams, SceneParams, SurroundingsParams, TlsParams, UavParams, WallMotion, WallParams,
};
use serde::{Deserialize, Serialize};

/// How the true masks are given to the project.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskFiles {
    /// As COCO json, one file an epoch.
    Coco,
    /// As a folder of 16-bit label PNGs an epoch.
    Png,
    /// Not at all: the project's own segmentation is to find the stones.
    None,
}

/// Parameters of a simulated survey; equal parameters give equal files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurveyParams {
    /// Name of the structure.
    pub name: String,
    /// Number of surveys, 1 or 2; the wall moves between them. One is enough for `split`, `tune` and
    /// `experiment paper`.
    pub epochs: u32,
    /// How masks reach the project.
    pub masks: MaskFiles,
    /// Quality of the photos' JPEG, 1 to 100; 92 as cameras write it.
    pub jpeg_quality: u8,
    /// Wall, surroundings, motion and scanners.
    pub scene: SceneParams,
    /// Camera and flight.
    pub photos: PhotoParams,
}

impl Default for SurveyParams {
    fn default() -> Self {
        Self {
            name: "Simulated dam".to_owned(),
            epochs: 2,
            masks: MaskFiles::Coco,
            jpeg_quality: 92,
            scene: SceneParams::default(),
            photos: PhotoParams::default(),
        }
    }
}

impl SurveyParams {
    /// The survey of `stonewise demo`: 3 x 2 m that settle, swell, and have two loose stones; small photos,
    /// so that it is made in seconds. The project gets no masks: the detector finds the stones. No building
    /// and no railing stand before the wall: the detector takes parts of a building for stones, and points on
    /// thin bars take the label of the stone behind them.
    pub fn demo() -> Self {
        let wall = WallParams {
            width_m: 3.0,
            height_m: 2.0,
            course_m: 0.24,
            aspect: 1.5,
            seed: 7,
            ..WallParams::default()
        };
        let motions = vec![
            WallMotion::Settlement {
                from_m: -1.5,
                to_m: 1.5,
                depth_m: 0.008,
            },
            WallMotion::Bulge {
                centre_m: [-0.3, 1.1],
                depth_m: 0.03,
                diameter_m: 1.8,
            },
            WallMotion::Loose {
                share: 0.0,
                at_least: 2,
                shift_m: [0.012, 0.02],
                rotation_rad: 0.02,
            },
        ];

        Self {
            name: "Demo wall".to_owned(),
            masks: MaskFiles::None,
            scene: SceneParams {
                wall,
                surroundings: SurroundingsParams {
                    annex: false,
                    railing: false,
                    ..SurroundingsParams::default()
                },
                motions,
                tls: Some(TlsParams {
                    spacing_m: 0.006,
                    ..TlsParams::default()
                }),
                seed: 7,
                ..SceneParams::default()
            },
            photos: PhotoParams {
                columns: 2,
                rows: 2,
                width: 1024,
                height: 768,
                focal_px: 1500.0,
                distance_m: 6.0,
                ..PhotoParams::default()
            },
            ..Self::default()
        }
    }

    /// A rubble-masonry gravity dam of this width and height, metres: curved in plan, battered, with annex,
    /// railing and shrubs; a terrestrial scan of 5 mm from stations 10 m apart, drone lidar of 9 mm, drone
    /// photos of 12 MP with the view of a 24 mm lens from 15 m (5.4 mm a pixel), as at the paper's dam. Up to
    /// 200 x 27.7 m and beyond.
    ///
    /// Photos of a section that is smaller than the picture are cropped to it.
    pub fn dam([width_m, height_m]: [f64; 2]) -> Self {
        // 24 mm on a frame with a diagonal of 43.27 mm, 5040 pixels.
        let focal_px = 24.0 / 43.27 * 5040.0;
        let distance_m = 15.0;
        let side =
            |size_m: f64, full: u32| ((size_m + 4.0) / distance_m * focal_px).min(f64::from(full)) as u32;
        let count = |size_m: f64, step_m: f64, least: u32| ((size_m / step_m).ceil() as u32).max(least);
        let motions = vec![
            WallMotion::Settlement {
                from_m: -0.25 * width_m,
                to_m: 0.25 * width_m,
                depth_m: 0.015,
            },
            WallMotion::Bulge {
                centre_m: [0.1 * width_m, 0.55 * height_m],
                depth_m: 0.05,
                diameter_m: 4.0_f64.min(0.6 * height_m),
            },
            WallMotion::Bending { crown_m: 0.004 },
            WallMotion::Loose {
                share: 0.01,
                at_least: 3,
                shift_m: [0.005, 0.03],
                rotation_rad: 0.03,
            },
        ];

        let scene = SceneParams {
            wall: WallParams {
                width_m,
                height_m,
                plan_radius_m: 150.0_f64.max(0.75 * width_m),
                ..WallParams::default()
            },
            surroundings: SurroundingsParams {
                shrubs: count(width_m, 6.0, 2),
                ..SurroundingsParams::default()
            },
            motions,
            tls: Some(TlsParams {
                stations: count(width_m, 10.0, 2),
                distance_m: 9.0_f64.max(0.8 * height_m),
                reach_m: if width_m > 40.0 { 20.0 } else { 0.0 },
                ..TlsParams::default()
            }),
            uav: Some(UavParams {
                strips: count(height_m, 6.0, 3),
                ..UavParams::default()
            }),
            ..SceneParams::default()
        };

        Self {
            name: format!("Simulated dam, {width_m} x {height_m} m"),
            masks: MaskFiles::Png,
            scene,
            photos: PhotoParams {
                columns: count(width_m, 7.0, 3),
                rows: count(height_m, 8.0, 2),
                width: side(width_m, 4032),
                height: side(height_m, 3024),
                focal_px,
                distance_m,
                placement_m: 0.5,
                ..PhotoParams::default()
            },
            ..Self::default()
        }
    }

    /// Sets the seeds of the wall, of its surroundings, and of the motions and measurements.
    pub fn seeded(self, seed: u64) -> Self {
        Self {
            scene: self.scene.seeded(seed),
            ..self
        }
    }

    /// Checks that every value is possible.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), SimulateError> {
        let (wall, photos) = (&self.scene.wall, &self.photos);
        let positive = [
            ("scene.wall.width_m", wall.width_m),
            ("scene.wall.height_m", wall.height_m),
            ("scene.wall.course_m", wall.course_m),
            ("scene.wall.aspect", wall.aspect),
            (
                "scene.tls.spacing_m",
                self.scene.tls.as_ref().map_or(1.0, |t| t.spacing_m),
            ),
            (
                "scene.tls.distance_m",
                self.scene.tls.as_ref().map_or(1.0, |t| t.distance_m),
            ),
            (
                "scene.uav.spacing_m",
                self.scene.uav.as_ref().map_or(1.0, |t| t.spacing_m),
            ),
            (
                "scene.uav.distance_m",
                self.scene.uav.as_ref().map_or(1.0, |t| t.distance_m),
            ),
            ("photos.focal_px", photos.focal_px),
            ("photos.distance_m", photos.distance_m),
        ];
        let places = self.scene.tls.iter().flat_map(|tls| &tls.places);
        let of_places = places.flat_map(|place| {
            [
                ("scene.tls.places.distance_m", place.distance_m),
                ("scene.tls.places.step_rad", place.step_rad),
            ]
        });

        for (key, value) in positive.into_iter().chain(of_places) {
            require(
                value.is_finite() && value > 0.0,
                key,
                value,
                "a positive number is needed",
            )?;
        }

        let shares = [
            ("scene.wall.tall_share", wall.tall_share),
            ("scene.wall.split_share", wall.split_share),
            ("scene.wall.flat_share", wall.flat_share),
        ];
        for (key, value) in shares {
            require((0.0..=1.0).contains(&value), key, value, "a share is 0 to 1")?;
        }
        let widths = wall.joint_width_m;
        require(
            0.0 <= widths[0] && widths[0] <= widths[1],
            "scene.wall.joint_width_m",
            format!("{widths:?}"),
            "smallest before largest, neither negative",
        )?;

        require(
            (1..=2).contains(&self.epochs),
            "epochs",
            self.epochs,
            "one or two surveys are made",
        )?;
        let size = photos.width.min(photos.height);
        require(
            size >= 16,
            "photos.width",
            size,
            "photos have at least 16 pixels a side",
        )?;
        require(
            photos.columns * photos.rows >= 1,
            "photos.columns",
            photos.columns,
            "at least one photo is needed",
        )?;

        require(
            self.scene.tls.is_some() || self.scene.uav.is_some(),
            "scene.tls",
            "none",
            "a survey needs a cloud from tls, uav or both",
        )
    }
}

fn require(
    fine: bool,
    key: &'static str,
    value: impl ToString,
    needed: &'static str,
) -> Result<(), SimulateError> {
    if fine {
        return Ok(());
    }
    Err(SimulateError::Parameter {
        key,
        value: value.to_string(),
        needed,
    })
}
