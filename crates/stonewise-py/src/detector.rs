//! Stones in photos.

use crate::arrays::table;
use crate::attended::{Listeners, attended};
use crate::command::parameters_of;
use crate::error::{error, explained};
use numpy::{PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use stonewise::Settings;
use stonewise_core::raster::RgbImage;
use stonewise_segment::tiling::{TilingOptions, outline_boxes, segment_photo};
use stonewise_segment::{Segmentation, StoneFinder, Weights};

/// Stone of every pixel, and the score of each stone.
type Found<'py> = (Bound<'py, PyArray2<i32>>, Vec<(u32, f32)>);

/// The detector of stones, ready to run.
#[pyclass(frozen, module = "stonewise._native")]
pub struct Detector {
    finder: StoneFinder,
    tiling: TilingOptions,
}

#[pymethods]
impl Detector {
    /// `tiling`: JSON of parameters of `[segment.tiling]`.
    #[new]
    fn new(py: Python<'_>, model: PathBuf, tiling: &str) -> PyResult<Self> {
        let tiling = parameters_of(tiling)?;
        let parameters = Map::from_iter([("segment".to_owned(), json!({ "tiling": Value::Object(tiling) }))]);
        let settings = Settings::default()
            .with_parameters(&parameters)
            .map_err(explained)?;
        let tiling = settings.segment.tiling;
        let weights = Weights::named(&model);
        let min_score = tiling.min_score as f32;
        let finder = py
            .detach(|| StoneFinder::open(&weights, min_score))
            .map_err(explained)?;
        Ok(Self { finder, tiling })
    }

    /// Stone of every pixel, 0 for none, and the score of each stone.
    fn segment<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Found<'py>> {
        let photo = photo(&image).ok_or_else(|| error("an image of shape (height, width, 3) is needed"))?;
        let found = attended(py, &Listeners::progress(progress), |progress| {
            progress.begin(
                "stones",
                self.tiling.tile_count(photo.width(), photo.height(), 1.0),
            );
            segment_photo(&self.finder, &photo, 1.0, None, &self.tiling, progress)
                .map_err(stonewise::Error::from)
        })?;
        arrays(py, found.map_err(explained)?)
    }

    /// Pixels of the stones in boxes (left, top, right, bottom), counted from 1, and the score of each stone.
    fn outline<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
        boxes: Vec<[f64; 4]>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Found<'py>> {
        let photo = photo(&image).ok_or_else(|| error("an image of shape (height, width, 3) is needed"))?;
        let found = attended(py, &Listeners::progress(progress), |progress| {
            progress.begin("stones", boxes.len() as u64);
            outline_boxes(&self.finder, &photo, None, &boxes, &self.tiling, progress)
                .map_err(stonewise::Error::from)
        })?;
        arrays(py, found.map_err(explained)?)
    }
}

fn arrays(py: Python<'_>, found: Segmentation) -> PyResult<Found<'_>> {
    let (width, height) = (found.labels.width() as usize, found.labels.height() as usize);
    let labels = found.labels.data().iter().map(|&l| l as i32).collect();
    Ok((
        table(py, height, width, labels)?,
        found.scores.into_iter().collect(),
    ))
}

/// The photo of an array of shape (height, width, 3).
fn photo(array: &PyReadonlyArray3<'_, u8>) -> Option<RgbImage> {
    let view = array.as_array();
    let (height, width, bands) = view.dim();
    if bands != 3 || height == 0 || width == 0 {
        return None;
    }
    let flat: Vec<u8> = view.iter().copied().collect();
    RgbImage::from_vec(
        u32::try_from(width).ok()?,
        u32::try_from(height).ok()?,
        flat.as_chunks::<3>().0.to_vec(),
    )
}
