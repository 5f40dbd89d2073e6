//! Other people's Mask R-CNN, as ONNX, run by ONNX Runtime.

use crate::model::paste_mask;
use crate::{Detection, Detector, Patch};
use ort::environment::Environment;
use ort::session::{Session, SessionOutputs};
use ort::value::Tensor;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use stonewise_core::raster::{Raster, ReliefMap, RgbImage};

/// Probability from which a pixel is part of a stone.
const THRESHOLD: f32 = 0.5;

/// A model that cannot be opened or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OnnxError {
    /// No usable ONNX Runtime.
    #[error("ONNX Runtime library {path}")]
    Library {
        /// The library.
        path: PathBuf,
        /// What went wrong.
        source: ort::LoadDynamicError,
    },
    /// The model could not be loaded.
    #[error("ONNX model {path}")]
    Model {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: ort::Error,
    },
    /// The model could not run.
    #[error("ONNX model")]
    Run(#[from] ort::Error),
    /// An output is missing or has another shape than Mask R-CNN's.
    #[error(
        "ONNX model: {0}; outputs must be boxes [n, 4], scores [n] and masks [n, 1, rows, columns] of 32-bit floats"
    )]
    Output(String),
}

/// A Mask R-CNN with the interface of torchvision's export: in, one image [3, rows, columns] or [1, 3, rows,
/// columns], red green blue, 0 to 1; out, in any order, boxes [n, 4] (left, top, right, bottom, pixels),
/// scores [n] and masks [n, 1, rows, columns], which cover either the image or each its box. Classes are not
/// told apart: what it finds is a stone.
pub struct OnnxDetector {
    session: Mutex<Session>,
    /// The model expects a batch of images, of which there is one.
    batched: bool,
}

/// ONNX Runtime has one environment a process.
static ENVIRONMENT: Mutex<Option<Environment>> = Mutex::new(None);

impl OnnxDetector {
    /// Opens a model with the ONNX Runtime library (1.17 or later) at `library`; the first library of a
    /// process serves all later calls.
    ///
    /// # Errors
    /// Library or model cannot be loaded.
    pub fn open(library: &Path, model: &Path) -> Result<Self, OnnxError> {
        let failed = |source| OnnxError::Model {
            path: model.to_owned(),
            source,
        };
        let environment = environment(library)?;
        let mut builder = Session::builder(&environment).map_err(failed)?;
        let session = builder.commit_from_file(model).map_err(failed)?;
        let shape = session
            .inputs()
            .first()
            .and_then(|input| input.dtype().tensor_shape());
        Ok(Self {
            batched: shape.is_some_and(|shape| shape.len() == 4),
            session: Mutex::new(session),
        })
    }
}

fn environment(library: &Path) -> Result<Environment, OnnxError> {
    let mut environment = ENVIRONMENT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = environment.as_ref() {
        return Ok(environment.clone());
    }
    let built = ort::init_from(library)
        .map_err(|source| OnnxError::Library {
            path: library.to_owned(),
            source,
        })?
        .build()?;
    Ok(environment.insert(built).clone())
}

impl Detector for OnnxDetector {
    type Error = OnnxError;

    fn detect(&self, image: &RgbImage, _: Option<&ReliefMap>) -> Result<Vec<Detection>, OnnxError> {
        let [width, height] = [image.width(), image.height()];
        let mut values = Vec::with_capacity(image.data().len() * 3);
        for channel in 0..3 {
            values.extend(image.data().iter().map(|pixel| f32::from(pixel[channel]) / 255.0));
        }
        let (rows, columns) = (i64::from(height), i64::from(width));
        let shape = if self.batched {
            vec![1, 3, rows, columns]
        } else {
            vec![3, rows, columns]
        };
        let input = Tensor::from_array((shape, values))?;
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let outputs = session.run(ort::inputs![input])?;
        let mut found = read(&outputs, [width, height])?;
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }
}

/// The detections among a model's outputs.
fn read(outputs: &SessionOutputs, size: [u32; 2]) -> Result<Vec<Detection>, OnnxError> {
    let (mut boxes, mut scores, mut masks) = (None, None, None);
    for place in 0..outputs.len() {
        let Ok((shape, values)) = outputs[place].try_extract_tensor::<f32>() else {
            continue;
        };
        let shape: Vec<usize> = shape
            .iter()
            .map(|&side| usize::try_from(side).unwrap_or(0))
            .collect();
        match shape[..] {
            [_, 4] => boxes = Some(values),
            [_] => scores = Some(values),
            [_, 1, rows, columns] => masks = Some((values, rows, columns)),
            _ => {}
        }
    }
    let missing = |what: &str| OnnxError::Output(format!("no {what}"));
    let boxes = boxes.ok_or_else(|| missing("boxes"))?.as_chunks::<4>().0;
    let scores = scores.ok_or_else(|| missing("scores"))?;
    let (masks, rows, columns) = masks.ok_or_else(|| missing("masks"))?;
    if boxes.len() != scores.len() || masks.len() != boxes.len() * rows * columns {
        return Err(OnnxError::Output(format!(
            "{} boxes, {} scores, {} mask values of {columns} x {rows}",
            boxes.len(),
            scores.len(),
            masks.len()
        )));
    }
    let whole = [columns, rows] == size.map(|side| side as usize);
    if !whole && rows != columns {
        return Err(OnnxError::Output(format!(
            "masks of {columns} x {rows} cover neither image nor box"
        )));
    }
    let masks = masks.chunks((rows * columns).max(1));
    let detection = |((bounds, score), mask): ((&[f32; 4], &f32), &[f32])| Detection {
        bounds: *bounds,
        score: *score,
        mask: if whole {
            crop(mask, *bounds, size)
        } else {
            paste_mask(mask, rows, *bounds, size)
        },
    };
    Ok(boxes.iter().zip(scores).zip(masks).map(detection).collect())
}

/// The part of an image of probabilities within a pixel of a box.
fn crop(mask: &[f32], [left, top, right, bottom]: [f32; 4], [width, height]: [u32; 2]) -> Patch {
    let range = |from: f32, to: f32, side: u32| {
        let first = ((from.floor() - 1.0).max(0.0) as u32).min(side.saturating_sub(1));
        (first, ((to.ceil() + 1.0) as u32).clamp(first + 1, side) - first)
    };
    let (left, columns) = range(left, right, width);
    let (top, rows) = range(top, bottom, height);
    let mut pixels = Raster::filled(columns, rows, false);
    for (row, line) in pixels.data_mut().chunks_mut(columns as usize).enumerate() {
        let start = (top as usize + row) * width as usize + left as usize;
        let values = &mask[start..start + columns as usize];
        line.iter_mut()
            .zip(values)
            .for_each(|(pixel, value)| *pixel = *value >= THRESHOLD);
    }
    Patch { left, top, pixels }
}
