//! From the frame of a project's positions to that of its clouds.

use super::super::{CameraError, malformed};
use super::parts::SceneReferenceFrame;
use super::project::{Item, Project};
use nalgebra::{Point3, Vector3};

const SCENE: &str = "scene_reference_frame";
/// Largest relative difference between the scales of axes that are taken as equal.
const SAME_SCALE: f64 = 1e-12;

/// The frame of a project's positions (the translated canonical frame: right-handed, one unit on all axes), as seen
/// from that of the clouds.
pub struct Frame {
    /// Definition of the system of the clouds, where the project has one.
    pub crs: Option<String>,
    scale: f64,
    shift: Vector3<f64>,
}

impl Frame {
    /// The frame that a calibration refers to. If no file describes it, positions stay as they are.
    ///
    /// # Errors
    /// The project has no frame, or one whose axes have different units.
    pub fn of(project: &Project, calibration: &Item) -> Result<Self, CameraError> {
        let is_source = |item: &&Item| calibration.sources.iter().any(|source| source.id == item.id);
        let scenes = || project.items.iter().filter(|item| item.kind == SCENE);
        let scene = scenes().find(is_source).or_else(|| scenes().next());
        let scene = scene.ok_or_else(|| project.lacks(SCENE))?;
        let files = project.load::<SceneReferenceFrame>(scene, "scene-reference-frame")?;
        let Some(file) = files.into_iter().next() else {
            return Ok(Self {
                crs: None,
                scale: 1.0,
                shift: Vector3::zeros(),
            });
        };

        let base = file.content.base_to_canonical;
        let [scale, others @ ..] = base.scale.0;
        let bad = |problem: &str| malformed(&file.path, "base_to_canonical scale", problem);
        if scale <= 0.0 {
            return Err(bad("the scale must be positive"));
        }
        if others
            .iter()
            .any(|other| (other / scale - 1.0).abs() > SAME_SCALE)
        {
            return Err(bad(
                "the axes have different units: export the project in a system with one unit for all axes",
            ));
        }
        Ok(Self {
            crs: Some(file.content.crs.definition),
            scale,
            shift: base.shift.0.into(),
        })
    }

    /// A position in the frame of the clouds.
    ///
    /// A left-handed system, whose first axis is north, is not swapped back: clouds have east first.
    pub fn place(&self, position: [f64; 3]) -> Point3<f64> {
        Point3::from((Vector3::from(position) - self.shift) / self.scale)
    }
}
