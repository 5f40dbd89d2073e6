//! A project: which surveys, and every parameter.

use crate::conditions::ConditionsFile;
use crate::edits::EditsFile;
use crate::instruments::InstrumentFile;
use crate::networks::NetworkFile;
use crate::sources::SourceRule;
use nalgebra::Point3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::messages::Said;
use stonewise_base::part::Part;
use stonewise_base::profile::Profile;
use stonewise_base::settings::{Align, Settings};
use stonewise_core::change::M3c2Params;
use stonewise_core::epoch::{EpochId, Epochs};
use stonewise_core::evaluate::MotionField;
use stonewise_core::geometry::View;
use stonewise_io::cameras::{CameraFile, MapFrame, find_photos, read_cameras_on_map};
use stonewise_io::cloud::cloud_crs;
use stonewise_segment::Weights;

/// A checked project: paths exist, values are possible.
#[derive(Clone, Debug)]
pub struct Project {
    /// The project file itself.
    pub path: PathBuf,
    /// Name of the structure.
    pub name: String,
    /// The surveys; two at least. The reference, from which motions count, comes first; the others follow in
    /// time order.
    pub epochs: Epochs<Epoch>,
    /// Parameters of all steps.
    pub settings: Settings,
    /// Notes for the user on how the file was read: another numbering of epochs, missing conditions.
    pub notes: Vec<Said>,
    /// Corrections by hand; absent where the project names none.
    pub edits: Option<EditsFile>,
    /// The file of readings; absent where the project names none.
    pub conditions: Option<ConditionsFile>,
    /// Files of other instruments.
    pub instruments: Vec<InstrumentFile>,
    /// Adjusted networks, one for an epoch at most.
    pub networks: Vec<NetworkFile>,
    /// Known lengths.
    pub distances: Vec<Distance>,
    /// Which points take part; all where absent. No key of the file: commands set it.
    pub part: Option<Part>,
}

/// One survey.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Name, as reports show it.
    pub name: String,
    /// Date of the survey, ISO 8601.
    pub date: Option<String>,
    /// Conditions during the survey by name, such as `reservoir_level_m`.
    pub conditions: BTreeMap<String, f64>,
    /// Point clouds, all in one frame.
    pub clouds: Vec<PathBuf>,
    /// Photos; where there are none, views of the clouds take their place.
    pub photos: Option<PhotoFiles>,
    /// In which photos stones are sought, where there are no masks.
    pub photo_choice: PhotoChoice,
    /// COCO json or folder of label PNGs.
    pub masks: Option<PathBuf>,
    /// Known motion of the points, applied after labelling.
    pub motion: Option<MotionField>,
    /// What counts as one station or strip.
    pub sources: SourceRule,
    /// The earlier epoch of whose survey this one is another part: the same source then has the same
    /// error in both.
    pub same_survey_as: Option<EpochId>,
    /// What the points come from; absent: as the files show it.
    pub origin: Option<Origin>,
    /// Name of the bundle adjustment that gave the cameras; absent: equal cameras mean one.
    pub bundle: Option<String>,
    /// What the project file says about where the clouds lie on the map.
    pub map: MapFrame,
}

/// In which photos of an epoch without masks stones are sought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PhotoChoice {
    /// In as many as the votes need (`[segment] photos_per_place`), at the scale that their stones need.
    #[default]
    Auto,
    /// In all of them, as they are.
    All,
}

/// What the points of an epoch come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// A laser scanner or lidar.
    Scanner,
    /// Photos, by dense matching.
    Photos,
}

/// A known length.
#[derive(Clone, Debug, PartialEq)]
pub struct Distance {
    /// The epoch whose cloud shows it.
    pub epoch: EpochId,
    /// Its ends in the frame of that cloud, metres.
    pub ends: [Point3<f64>; 2],
    /// Its length, metres.
    pub length_m: f64,
    /// Standard deviation of the length, metres.
    pub sd_m: f64,
    /// The file that names it, and the line.
    pub stated: (PathBuf, usize),
}

impl Distance {
    /// An error about it.
    pub fn error(&self, message: impl Into<String>) -> Error {
        let (path, line) = self.stated.clone();
        Error::Project {
            path,
            line,
            message: message.into(),
        }
    }
}

/// Photos with their cameras.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhotoFiles {
    /// Folder of the photos.
    pub images: PathBuf,
    /// Camera file or COLMAP folder.
    pub cameras: PathBuf,
}

impl Epoch {
    /// Whether it is another part of the survey of the reference.
    pub fn is_of_reference_survey(&self) -> bool {
        self.same_survey_as == Some(EpochId::REFERENCE)
    }

    /// Reads the camera file; cameras that lie on the earth are brought to the system of the clouds. An epoch
    /// without photos has no cameras.
    ///
    /// # Errors
    /// A cloud's header or the camera file cannot be read; the system of the cameras is not supported.
    pub fn read_cameras(&self) -> Result<CameraFile> {
        let Some(photos) = &self.photos else {
            return Ok(CameraFile::default());
        };
        let mut map = self.map.clone();
        for cloud in self.clouds.iter().take_while(|_| self.map.crs.is_none()) {
            map.crs = map.crs.or(cloud_crs(cloud)?);
        }
        Ok(read_cameras_on_map(&photos.cameras, Some(&photos.images), &map)?)
    }

    /// The photos that are there and have a camera.
    ///
    /// # Errors
    /// As [`Epoch::read_cameras`]; the folder of the photos cannot be read.
    pub fn posed_photos(&self) -> Result<Vec<(View, PathBuf)>> {
        let Some(files) = &self.photos else {
            return Ok(Vec::new());
        };
        let cameras = self.read_cameras()?;
        let photos = find_photos(&files.images, &cameras)?;
        let posed = cameras.views.into_iter().zip(photos.paths);
        Ok(posed.filter_map(|(view, path)| Some((view, path?))).collect())
    }
}

impl Project {
    /// Every file and folder that the project reads, the project file first.
    pub fn inputs(&self) -> Vec<PathBuf> {
        let mut inputs = vec![self.path.clone()];
        inputs.extend(
            self.epochs
                .iter()
                .next()
                .and_then(|epoch| epoch.map.geoid.clone()),
        );
        for epoch in &self.epochs {
            inputs.extend(epoch.clouds.iter().cloned());
            let photos = epoch.photos.iter();
            inputs.extend(photos.flat_map(|p| [p.images.clone(), p.cameras.clone()]));
            inputs.extend(epoch.masks.clone());
        }
        if let Weights::File(file) = Weights::named(&self.settings.segment.model) {
            inputs.push(file);
        }
        inputs.extend(self.settings.report.logo.clone());
        let profile = &self.settings.report.profile;
        inputs.extend(Profile::shipped(profile).is_none().then(|| profile.clone()));
        inputs.extend(self.edits.as_ref().map(|edits| edits.path.clone()));
        inputs.extend(self.conditions.as_ref().map(|file| file.path.clone()));
        inputs.extend(self.instrument_files().map(Path::to_path_buf));
        inputs
    }

    /// The files of other instruments.
    pub fn instrument_files(&self) -> impl Iterator<Item = &Path> {
        let networks = self.networks.iter().flat_map(|n| &n.network.files);
        let files = self.instruments.iter().map(|file| &file.path);
        files.chain(networks).map(PathBuf::as_path)
    }

    /// The adjusted network of an epoch.
    pub fn network(&self, epoch: EpochId) -> Option<&NetworkFile> {
        self.networks.iter().find(|n| n.epoch == epoch)
    }

    /// Whether the stones themselves bring an epoch to the frame of the reference.
    pub fn is_aligned(&self, epoch: EpochId) -> bool {
        !epoch.is_reference() && self.settings.registration.align == Align::Stones
    }

    /// Whether the photos are chosen in which the detector looks for stones of an epoch.
    pub fn chooses_photos(&self, epoch: EpochId) -> bool {
        let own = &self.epochs[epoch];
        own.masks.is_none() && own.photos.is_some() && own.photo_choice == PhotoChoice::Auto
    }

    /// Whether the detector looks at views of the clouds of an epoch: in place of photos, or beside them with
    /// `beside_photos`.
    pub fn has_views(&self, epoch: EpochId) -> bool {
        let own = &self.epochs[epoch];
        own.photos.is_none() || self.settings.views.beside_photos && own.masks.is_none()
    }

    /// Two clouds without photos, for comparisons of clouds alone.
    pub fn of_clouds(before: &Path, after: &Path, m3c2: M3c2Params) -> Self {
        let epoch = |name: &str, cloud: &Path| Epoch {
            name: name.to_owned(),
            date: None,
            conditions: BTreeMap::new(),
            clouds: vec![cloud.to_path_buf()],
            photos: None,
            photo_choice: PhotoChoice::default(),
            masks: None,
            motion: None,
            sources: SourceRule::default(),
            same_survey_as: None,
            origin: None,
            bundle: None,
            map: MapFrame::default(),
        };
        Self {
            path: before.to_path_buf(),
            name: "clouds".to_owned(),
            epochs: vec![epoch("before", before), epoch("after", after)].into(),
            settings: Settings {
                m3c2,
                ..Settings::default()
            },
            notes: Vec::new(),
            edits: None,
            conditions: None,
            instruments: Vec::new(),
            networks: Vec::new(),
            distances: Vec::new(),
            part: None,
        }
    }
}
