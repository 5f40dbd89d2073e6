//! From labels of photos to labels of points.

use crate::arrays::points;
use crate::attended::{Listeners, attended};
use crate::clouds::Tiled;
use crate::command::parameters_of;
use crate::error::{error, explained};
use crate::view::View;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use std::convert::Infallible;
use stonewise::Settings;
use stonewise_core::geometry;
use stonewise_core::id::ImageId;
use stonewise_core::raster::LabelImage;
use stonewise_core::transfer::{MemoryLabels, transfer_labels};

/// Stone of every point, and the share of the votes that the outcome got.
type Labels<'py> = (Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<f32>>);

/// Stone of every point, 0 for none, and the share of the votes that the outcome got.
#[pyfunction]
pub fn transfer<'py>(
    py: Python<'py>,
    cloud: PyReadonlyArray2<'py, f64>,
    views: Vec<PyRef<'py, View>>,
    labels: Vec<Option<PyReadonlyArray2<'py, u32>>>,
    parameters: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Labels<'py>> {
    if views.len() != labels.len() {
        let message = format!("{} views and {} label images", views.len(), labels.len());
        return Err(error(message));
    }

    let settings = Settings::default()
        .with_parameters(&parameters_of(parameters)?)
        .map_err(explained)?;
    let cloud = points(&cloud)?;
    let views: Vec<geometry::View> = views
        .iter()
        .zip(0..)
        .map(|(view, number)| geometry::View {
            image: ImageId(number),
            ..view.0.clone()
        })
        .collect();
    let mut images: Vec<Option<LabelImage>> = labels.iter().map(|l| l.as_ref().and_then(image)).collect();
    let found = attended(py, &Listeners::progress(progress), |progress| {
        let tiled = Tiled::new(&cloud, settings.ingest.size_m);
        let mut store = MemoryLabels::default();
        let mask =
            |image: ImageId| Ok::<_, Infallible>(images.get_mut(image.0 as usize).and_then(Option::take));
        let (tiles, params) = (&tiled.tiles, &settings.label);
        transfer_labels(tiles, &views, mask, &mut store, params, progress).map_err(stonewise::Error::from)?;
        let (mut stones, mut shares) = (vec![0i32; cloud.len()], vec![0f32; cloud.len()]);
        for (list, labels) in tiled.indices.iter().zip(&store.tiles) {
            for ((&i, &stone), &share) in list.iter().zip(&labels.stone).zip(&labels.confidence) {
                (stones[i], shares[i]) = (stone as i32, share);
            }
        }
        Ok::<_, stonewise::Error>((stones, shares))
    })?;

    let (stones, shares) = found.map_err(explained)?;
    Ok((stones.into_pyarray(py), shares.into_pyarray(py)))
}

/// The image of an array of shape (height, width).
fn image(array: &PyReadonlyArray2<'_, u32>) -> Option<LabelImage> {
    let view = array.as_array();
    let (height, width) = view.dim();
    LabelImage::from_vec(
        u32::try_from(width).ok()?,
        u32::try_from(height).ok()?,
        view.iter().copied().collect(),
    )
}
