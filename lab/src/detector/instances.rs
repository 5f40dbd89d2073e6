//! Writes what a model with torchvision's weights finds in images, as JSON, and how long it took: `instances
//! WEIGHTS.safetensors OUT.json IMAGE...`. testdata/mask_rcnn/compare_photos.py compares it with torchvision.

use crate::Outcome;
use crate::words::Words;
use std::path::Path;
use std::time::Instant;
use stonewise_core::raster::Raster;
use stonewise_segment::model::{BackboneConfig, MaskRcnn, MaskRcnnConfig, Norm, load_weights};

pub fn run(words: &Words) -> Outcome {
    let [weights, out, images @ ..] = words.as_slice() else {
        return Err("usage: instances WEIGHTS.safetensors OUT.json IMAGE...".into());
    };
    let mut config = MaskRcnnConfig::torchvision_r50();
    if let BackboneConfig::Resnet(resnet) = &mut config.backbone {
        resnet.norm = Norm::FrozenBatch { epsilon: 1e-5 };
    }
    let model = load_weights(MaskRcnn::zeros(&config)?, Path::new(weights))?.for_inference();
    let mut photos = Vec::new();

    for path in images {
        let image = read(Path::new(path))?;
        let megapixels = f64::from(image.width()) * f64::from(image.height()) * 1e-6;
        let start = Instant::now();
        let found = model.instances(&image, None);
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{}: {} objects, {seconds:.2} s, {:.2} s/MP",
            path,
            found.len(),
            seconds / megapixels
        );
        let size = [image.width(), image.height()];
        let objects = found.iter().map(|instance| {
            let patch = stonewise_segment::model::paste_mask(&instance.mask, 28, instance.bounds, size);
            serde_json::json!({
                "bounds": instance.bounds, "class": instance.class, "score": instance.score, "mask": instance.mask,
                "left": patch.left, "top": patch.top, "width": patch.pixels.width(),
                "pixels": patch.pixels.data().iter().map(|&inside| u8::from(inside)).collect::<Vec<_>>(),
            })
        });
        photos.push(serde_json::Value::Array(objects.collect()));
    }

    std::fs::write(out, serde_json::to_vec(&photos)?)?;
    Ok(())
}

fn read(path: &Path) -> Result<Raster<[u8; 3]>, Box<dyn std::error::Error>> {
    let image = image::open(path)?.into_rgb8();
    let pixels = image.pixels().map(|pixel| pixel.0).collect();
    let raster = Raster::from_vec(image.width(), image.height(), pixels);
    Ok(raster.expect("as many pixels as rows times columns"))
}
