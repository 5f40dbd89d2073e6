//! `[report]` of the project file: what the first page of the report says about who measured with what.

pub use crate::language::Language;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What the first page of the report shows beside the results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReportParams {
    /// Who measured. Default: nothing is shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// With which instruments. Default: nothing is shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instruments: Option<String>,
    /// Calibration or field test of the scanner, such as the record of its test by ISO 17123-9. Default: nothing is
    /// shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Number of the report in the operator's or the authority's files. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_number: Option<String>,
    /// A PNG or JPEG picture for the first page. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub logo: Option<PathBuf>,
    /// Language of the verdict and of the first page.
    pub language: Language,
    /// Order of the chapters, and their words: `plain`, `din19700`, or a profile of one's own, a file.
    pub profile: PathBuf,
}

impl Default for ReportParams {
    fn default() -> Self {
        Self {
            operator: None,
            instruments: None,
            calibration: None,
            reference_number: None,
            logo: None,
            language: Language::default(),
            profile: "plain".into(),
        }
    }
}

/// Largest logo, bytes: it is part of every report.
const MAX_LOGO_BYTES: u64 = 1_000_000;

/// The media type of a logo.
///
/// # Errors
/// It is neither a PNG nor a JPEG, or is too large; the text says what to do.
pub fn logo_type(path: &Path) -> Result<&'static str, String> {
    let extension = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let kind = match extension.as_str() {
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        _ => return Err(format!("{} is neither .png nor .jpg", path.display())),
    };
    let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
    if bytes > MAX_LOGO_BYTES {
        return Err(format!(
            "{} is larger than 1 MB: give a smaller picture",
            path.display()
        ));
    }
    Ok(kind)
}
