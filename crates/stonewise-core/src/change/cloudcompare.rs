//! CloudCompare's M3C2 parameter file.

use crate::change::M3c2Params;
use crate::params::{ParamError, Params};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Why a CloudCompare parameter file cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudCompareError {
    /// Not such a file.
    #[error("no M3C2VER in the [General] section: this is not an M3C2 parameter file of CloudCompare")]
    NotM3c2,
    /// A key that is needed is not there.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A value that is neither a number nor true or false, as the key needs.
    #[error("line {line}: {key}={value} is not {expected}")]
    Value {
        /// Line of the file, from 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// What stands there.
        value: String,
        /// What should.
        expected: &'static str,
    },
    /// A setting that has no counterpart here.
    #[error("line {line}: {key}={value} is not supported, {fix}")]
    Unsupported {
        /// Line of the file, from 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// What stands there.
        value: String,
        /// What to do.
        fix: &'static str,
    },
    /// A value out of range.
    #[error(transparent)]
    Params(#[from] ParamError),
}

/// M3C2 parameters from the text of the file that CloudCompare's M3C2 dialog saves.
///
/// NormalScale and SearchScale are diameters, SearchDepth is a half-length; all three are needed.
/// RegistrationError and SubsampleRadius count where their ...Enabled key is true; MinPoints4Stat where
/// UseMinPoints4Stat is true (5 otherwise, as in CloudCompare). The divisor of the variance becomes n (`ddof`
/// 0), as CloudCompare's. Normals are computed at the core points (NormalMode 0) and point out of the wall,
/// so NormalPreferedOri does not count; neither do other keys, such as those about output.
///
/// # Errors
/// A key is missing or no number, or an option is set that is not supported; the error names it.
pub fn params_from_cloudcompare(text: &str) -> Result<M3c2Params, CloudCompareError> {
    let file = Settings::of(text);
    if !file.entries.contains_key("M3C2VER") {
        return Err(CloudCompareError::NotM3c2);
    }
    file.refuse("NormalMode", "0", "choose the default normal computation")?;
    file.refuse("PositiveSearchOnly", "false", "search in both directions")?;
    file.refuse("UsePrecisionMaps", "false", "switch the precision maps off")?;
    let default = M3c2Params::default();
    let params = M3c2Params {
        normal_radius_m: 0.5 * file.needed("NormalScale")?,
        cylinder_radius_m: 0.5 * file.needed("SearchScale")?,
        max_depth_m: file.needed("SearchDepth")?,
        core_spacing_m: file
            .enabled("SubsampleEnabled", "SubsampleRadius")?
            .unwrap_or(default.core_spacing_m),
        robust: file.flag("UseMedian")?,
        min_points: file
            .enabled("UseMinPoints4Stat", "MinPoints4Stat")?
            .map_or(default.min_points, |n| n.max(0.0) as u32),
        ddof: 0,
        registration_error_m: file
            .enabled("RegistrationErrorEnabled", "RegistrationError")?
            .unwrap_or(0.0),
    };
    params.check()?;
    Ok(params)
}

/// The text of the file with which CloudCompare repeats a comparison on given core points: [`params_from_cloudcompare`]
/// reads the same parameters back, except that CloudCompare divides variances by n (`ddof` 0).
///
/// CloudCompare turns every normal to one side of one axis: that of the largest component of `outward`. Cylinders are
/// searched at once, as here, and not progressively.
pub fn params_to_cloudcompare(params: &M3c2Params, outward: &Vector3<f64>) -> String {
    let axis = outward.iamax();
    // +X, -X, +Y, -Y, +Z, -Z.
    let orientation = 2 * axis + usize::from(outward[axis] < 0.0);
    let entries = [
        ("M3C2VER", "1".to_owned()),
        ("NormalScale", (2.0 * params.normal_radius_m).to_string()),
        ("NormalMode", "0".to_owned()),
        ("NormalUseCorePoints", "false".to_owned()),
        ("NormalPreferedOri", orientation.to_string()),
        ("SearchScale", (2.0 * params.cylinder_radius_m).to_string()),
        ("SearchDepth", params.max_depth_m.to_string()),
        ("SubsampleRadius", params.core_spacing_m.to_string()),
        ("SubsampleEnabled", "true".to_owned()),
        ("RegistrationError", params.registration_error_m.to_string()),
        ("RegistrationErrorEnabled", "true".to_owned()),
        ("UseSinglePass4Depth", "true".to_owned()),
        ("PositiveSearchOnly", "false".to_owned()),
        ("UseMedian", params.robust.to_string()),
        ("UseMinPoints4Stat", "true".to_owned()),
        ("MinPoints4Stat", params.min_points.to_string()),
        ("ProjDestIndex", "2".to_owned()),
        ("UseOriginalCloud", "false".to_owned()),
        ("ExportStdDevInfo", "true".to_owned()),
        ("ExportDensityAtProjScale", "true".to_owned()),
        ("UsePrecisionMaps", "false".to_owned()),
    ];
    let lines = entries.map(|(key, value)| format!("{key}={value}\n"));
    format!("[General]\n{}", lines.concat())
}

/// The [General] section: key to line number and value.
struct Settings<'a> {
    entries: BTreeMap<&'a str, (usize, &'a str)>,
}

impl<'a> Settings<'a> {
    fn of(text: &'a str) -> Self {
        let mut entries = BTreeMap::new();
        let mut general = true;
        for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let line = line.trim();
            if line.starts_with('[') {
                general = line.eq_ignore_ascii_case("[General]");
            } else if let Some((key, value)) =
                line.split_once('=').filter(|_| general && !line.starts_with(';'))
            {
                entries.insert(key.trim(), (number + 1, value.trim().trim_matches('"')));
            }
        }
        Self { entries }
    }

    fn number(&self, key: &'static str) -> Result<Option<f64>, CloudCompareError> {
        let Some(&(line, value)) = self.entries.get(key) else {
            return Ok(None);
        };
        let number = value.parse::<f64>().ok().filter(|v| v.is_finite());
        number.map(Some).ok_or_else(|| CloudCompareError::Value {
            line,
            key,
            value: value.to_owned(),
            expected: "a number",
        })
    }

    fn needed(&self, key: &'static str) -> Result<f64, CloudCompareError> {
        self.number(key)?.ok_or(CloudCompareError::Missing(key))
    }

    fn flag(&self, key: &'static str) -> Result<bool, CloudCompareError> {
        match self.entries.get(key) {
            None => Ok(false),
            Some((_, value)) if value.eq_ignore_ascii_case("true") || *value == "1" => Ok(true),
            Some((_, value)) if value.eq_ignore_ascii_case("false") || *value == "0" => Ok(false),
            Some((line, value)) => Err(CloudCompareError::Value {
                line: *line,
                key,
                value: (*value).to_owned(),
                expected: "true or false",
            }),
        }
    }

    /// The number of `key`, needed only where `switch` is true.
    fn enabled(&self, switch: &'static str, key: &'static str) -> Result<Option<f64>, CloudCompareError> {
        if self.flag(switch)? {
            self.needed(key).map(Some)
        } else {
            Ok(None)
        }
    }

    fn refuse(&self, key: &'static str, only: &str, fix: &'static str) -> Result<(), CloudCompareError> {
        match self.entries.get(key) {
            Some((line, value)) if !value.eq_ignore_ascii_case(only) => Err(CloudCompareError::Unsupported {
                line: *line,
                key,
                value: (*value).to_owned(),
                fix,
            }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "[General]\r\nM3C2VER=1\r\nNormalScale=0.5\r\nNormalMode=0\r\nNormalMinScale=0.25\r\n\
        NormalPreferedOri=4\r\nSearchScale=0.1\r\nSearchDepth=0.4\r\nSubsampleRadius=0.08\r\nSubsampleEnabled=true\r\n\
        RegistrationError=0.002\r\nRegistrationErrorEnabled=true\r\nPositiveSearchOnly=false\r\nUseMedian=true\r\n\
        UseMinPoints4Stat=false\r\nMinPoints4Stat=9\r\nExportStdDevInfo=true\r\nMaxThreadCount=8\r\n";

    #[test]
    fn scales_are_diameters_and_the_depth_is_a_half_length() {
        let expected = M3c2Params {
            normal_radius_m: 0.25,
            cylinder_radius_m: 0.05,
            max_depth_m: 0.4,
            core_spacing_m: 0.08,
            robust: true,
            min_points: 5,
            ddof: 0,
            registration_error_m: 0.002,
        };
        assert_eq!(params_from_cloudcompare(FILE), Ok(expected));
        let off = FILE.replace("Enabled=true", "Enabled=false");
        let params = params_from_cloudcompare(&off).unwrap();
        assert_eq!((params.registration_error_m, params.core_spacing_m), (0.0, 0.05));
        let counted = FILE.replace("UseMinPoints4Stat=false", "UseMinPoints4Stat=true");
        assert_eq!(params_from_cloudcompare(&counted).unwrap().min_points, 9);
    }

    #[test]
    fn what_is_written_is_read_back() {
        let params = M3c2Params {
            normal_radius_m: 0.3,
            cylinder_radius_m: 0.07,
            max_depth_m: 0.45,
            core_spacing_m: 0.11,
            robust: true,
            min_points: 8,
            ddof: 0,
            registration_error_m: 0.0015,
        };
        let text = params_to_cloudcompare(&params, &Vector3::new(0.1, -0.9, 0.2));
        assert_eq!(params_from_cloudcompare(&text), Ok(params));
        assert!(text.contains("\nNormalPreferedOri=3\n"), "{text}");
    }

    #[test]
    fn what_is_missing_wrong_or_unsupported_is_named() {
        let message = |text: String| params_from_cloudcompare(&text).unwrap_err().to_string();
        assert!(message(FILE.replace("M3C2VER", "VER")).contains("M3C2VER"));
        assert_eq!(
            message(FILE.replace("SearchDepth=0.4", "")),
            "SearchDepth is missing"
        );
        assert!(message(FILE.replace("=0.5", "=half")).contains("line 3: NormalScale=half"));
        assert!(
            message(FILE.replace("NormalMode=0", "NormalMode=2")).contains("NormalMode=2 is not supported")
        );
        assert!(message(FILE.replace("=0.4", "=-1")).contains("max_depth_m"));
    }
}
