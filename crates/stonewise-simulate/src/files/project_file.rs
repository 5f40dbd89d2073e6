//! The project file of a simulated survey.

use crate::files::{MaskFiles, SimulateError, SurveyParams};
use serde::Serialize;

#[derive(Serialize)]
struct ProjectFile {
    project: Named,
    epochs: Vec<EpochEntry>,
}

#[derive(Serialize)]
struct Named {
    name: String,
}

#[derive(Serialize)]
struct EpochEntry {
    name: String,
    clouds: Vec<String>,
    images: String,
    cameras: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    masks: Option<String>,
}

/// Text of a project that uses the cloud of one sensor: `tls` or `uav`.
pub fn project_text(params: &SurveyParams, sensor: &str) -> Result<String, SimulateError> {
    let epochs = (1..=params.epochs)
        .map(|e| EpochEntry {
            name: format!("epoch {e}"),
            clouds: vec![format!("epoch{e}/cloud_{sensor}.laz")],
            images: format!("epoch{e}/images"),
            cameras: format!("epoch{e}/cameras_metashape.xml"),
            masks: match params.masks {
                MaskFiles::Coco => Some(format!("masks/epoch{e}.json")),
                MaskFiles::Png => Some(format!("masks/epoch{e}")),
                MaskFiles::None => None,
            },
        })
        .collect();
    let file = ProjectFile {
        project: Named {
            name: params.name.clone(),
        },
        epochs,
    };
    Ok(toml::to_string(&file)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_quotes_and_line_breaks_come_back() {
        let params = SurveyParams {
            name: "Wall \"A\"\n= # x".to_owned(),
            ..SurveyParams::default()
        };
        let text = project_text(&params, "tls").unwrap();
        let read: toml::Table = text.parse().unwrap();
        assert_eq!(read["project"]["name"].as_str(), Some("Wall \"A\"\n= # x"));
        assert_eq!(
            read["epochs"][1]["clouds"][0].as_str(),
            Some("epoch2/cloud_tls.laz")
        );
    }
}
