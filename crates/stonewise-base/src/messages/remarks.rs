//! Remarks of readers of camera files, and why edits have no effect, in both languages.

use super::Said;
use stonewise_core::transfer::NoEffect;
use stonewise_io::cameras::Remark;

impl From<&Remark> for Said {
    fn from(remark: &Remark) -> Self {
        Self {
            code: None,
            english: remark.to_string(),
            german: german(remark),
        }
    }
}

fn german(remark: &Remark) -> Option<String> {
    Some(match remark {
        Remark::NotAligned => "nicht ausgerichtet".to_owned(),
        Remark::Disabled => "in Metashape abgeschaltet".to_owned(),
        Remark::SmallerReconstruction => "in einer getrennten, kleineren Rekonstruktion".to_owned(),
        Remark::SeveralReconstructions(n) => {
            format!("{n} Rekonstruktionen in der Datei; nur die größte wurde gelesen")
        }
        Remark::LargestModel {
            read: (read, photos),
            others,
        } => {
            let others: Vec<String> = others.iter().map(|(place, n)| format!("{place} ({n})")).collect();
            format!(
                "das Modell {read} wurde gelesen, mit {photos} Fotos das größte, und nicht {}: Modelle haben kein gemeinsames System",
                others.join(", ")
            )
        }
        Remark::ChunkDisabled(chunk) => format!("Chunk {chunk} ist abgeschaltet und wurde nicht gelesen"),
        Remark::ChunkNotRead { chunk, used } => format!(
            "Chunk {chunk} wurde nicht gelesen, nur {used}, der erste mit ausgerichteten Kameras"
        ),
        Remark::RollingShutter => {
            "der Rolling Shutter der Kamera wird nicht korrigiert, wenn Steine aus den Fotos in die Punktwolken \
             übertragen werden: Punkte können im Foto um einige Pixel versetzt liegen"
                .to_owned()
        }
        Remark::YawFromTrueNorth => {
            "die Datei gibt Orte auf der Karte, aber den Gierwinkel ab geographisch Nord; alle Kameras können um den \
             Winkel zwischen beiden Nordrichtungen verdreht sein: XMP-Dateien oder die OpenCV-konformen \
             Kameraparameter exportieren"
                .to_owned()
        }
        Remark::RigSlave | Remark::NotPlaced(_) => return None,
    })
}

impl From<&NoEffect> for Said {
    fn from(reason: &NoEffect) -> Self {
        let german = match reason {
            NoEffect::NoStone { at } => {
                format!("kein Stein bei ({:.2}; {:.2}) m", at.x, at.y).replace('.', ",")
            }
            NoEffect::OneStone { stone } => format!("nennt nur einen einzigen Stein: {stone}"),
            NoEffect::NotCrossed => "die Linie quert keinen Stein von Rand zu Rand".to_owned(),
            NoEffect::SmallPart {
                stone,
                points,
                needed,
            } => format!("ein Teil von Stein {stone} hätte zu wenige Punkte: {points}, {needed} sind nötig"),
            NoEffect::FewPoints { points, needed } => {
                format!("zu wenige Punkte im Umriss gehören zu keinem Stein: {points}, {needed} sind nötig")
            }
            NoEffect::NothingInside => "im Umriss liegt kein Stein".to_owned(),
            NoEffect::NoPlace(reason) => reason.clone(),
        };
        Self {
            german: Some(german),
            ..reason.to_string().into()
        }
    }
}
