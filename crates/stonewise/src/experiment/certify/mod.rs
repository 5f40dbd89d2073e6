//! A certificate: what the program reaches where the truth is simulated or put in, on this machine, with
//! tolerances stated beforehand.

mod calibration;
mod certificate;
mod own;
mod page;
mod walls;

use crate::error::Result;
use crate::files::write_readable_json;
use crate::processor_class;
use crate::results::records::Timestamp;
use crate::storage::step::code_version;
use crate::storage::store::{Keeps, StepStore};
pub use calibration::{CalibratedSurvey, Calibration, CalibrationOptions, CalibrationRow, calibrate};
pub use certificate::{Certificate, CertifyOptions, Figure};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::progress::Progress;

/// The certificate as JSON.
const JSON: &str = "certificate.json";
/// The certificate as an HTML page.
const PAGE: &str = "certificate.html";

/// Makes a certificate and writes it into `out` as JSON and HTML. An interrupted one goes on where it stopped.
///
/// # Errors
/// What stops a simulation or a run. A figure outside its allowed range is not an error.
pub fn certify(options: &CertifyOptions, out: &Path, progress: &dyn Progress) -> Result<Certificate> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let mut figures = walls::figures(options, out, &store, progress)?;
    if let Some(project) = &options.project {
        figures.extend(own::figures(project, options.seed, out, &store, progress)?);
    }
    let certificate = Certificate {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        program: code_version(),
        processor: processor_class().to_owned(),
        made_at: Timestamp::now(),
        seed: options.seed,
        project: options.project.as_ref().map(|p| p.path.clone()),
        holds: figures.iter().all(|f| f.holds),
        figures,
    };
    write_readable_json(&out.join(JSON), &certificate)?;
    page::write(&certificate, &out.join(PAGE))?;
    Ok(certificate)
}
