//! Parameters that a caller gives beside the project file.

use crate::Project;
use serde_json::{Map, Value};
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_base::profile::Profile;
use stonewise_base::report_params::logo_type;
use stonewise_segment::Weights;

impl Project {
    /// The project with other parameters: tables as in the project file, such as `{"registration":
    /// {"estimator": "gicp"}}`. What is not named stays; a path is relative to the project file.
    ///
    /// # Errors
    /// No such parameter, a value of the wrong kind, an impossible value, a file that does not exist.
    pub fn with_parameters(mut self, parameters: &Map<String, Value>) -> Result<Self> {
        let before = self.settings.clone();
        let folder = self.path.parent().unwrap_or(Path::new(""));
        self.settings = before.with_parameters(parameters)?;
        let model = &mut self.settings.segment.model;
        if *model != before.segment.model
            && let Weights::File(file) = Weights::named(model)
        {
            *model = folder.join(file);
            if !model.exists() {
                let message = format!("segment.model: no such file: {}", model.display());
                return Err(Error::Parameters(message));
            }
        }
        if self.settings.report.logo != before.report.logo
            && let Some(logo) = &mut self.settings.report.logo
        {
            *logo = folder.join(&*logo);
            if !logo.exists() {
                let message = format!("report.logo: no such file: {}", logo.display());
                return Err(Error::Parameters(message));
            }
            if let Err(reason) = logo_type(logo) {
                return Err(Error::Parameters(format!("report.logo: {reason}")));
            }
        }
        let profile = &mut self.settings.report.profile;
        if *profile != before.report.profile && Profile::shipped(profile).is_none() {
            *profile = folder.join(&*profile);
            Profile::read(profile)?;
        }
        Ok(self)
    }
}
