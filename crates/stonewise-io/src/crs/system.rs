//! Coordinate reference systems as point clouds name them.

use super::epsg::definition;
use super::wkt::Node;

/// A coordinate reference system that is tied to the earth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Crs {
    /// Its code in the EPSG register, where it has one.
    pub epsg: Option<i32>,
    /// Name.
    pub name: String,
    /// Definition as WKT 1 or WKT 2; empty where only the code is known, and the table does not have it.
    pub wkt: String,
}

impl Crs {
    /// The system that a text names: WKT 1 or 2, `EPSG:25832` or `EPSG:25832+7837`.
    ///
    /// Of a compound system without a code of its own, the horizontal part counts. `None` for a local frame, and for
    /// what is no text of a system.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        if let Some(code) = text.strip_prefix("EPSG:") {
            return match definition(code) {
                Some(wkt) => Self::parse(&wkt),
                None => Some(Self {
                    epsg: Some(code.trim().parse().ok()?),
                    name: text.to_owned(),
                    wkt: String::new(),
                }),
            };
        }
        let root = Node::parse(text)?;
        let crs = if root.code().is_some() || root.is_crs() {
            &root
        } else {
            root.children.iter().find(|c| c.is_crs())?
        };
        Some(Self {
            epsg: crs.code(),
            name: crs.name()?,
            wkt: crs.text.to_owned(),
        })
    }

    /// The definition, or the code where there is none: [`Crs::parse`] gives the same system again.
    pub fn text(&self) -> String {
        match self.epsg {
            Some(code) if self.wkt.is_empty() => format!("EPSG:{code}"),
            _ => self.wkt.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: &str = r#"PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",DATUM["European",SPHEROID["GRS 1980",6378137,298.257222101]],
        AUTHORITY["EPSG","4258"]],PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",9],UNIT["metre",1],AUTHORITY["EPSG","25832"]]"#;

    #[test]
    fn the_code_is_the_systems_own_and_not_that_of_its_parts() {
        let crs = Crs::parse(UTM).unwrap();
        assert_eq!(
            (crs.epsg, crs.name.as_str()),
            (Some(25832), "ETRS89 / UTM zone 32N")
        );
        assert_eq!(crs.wkt, UTM);
        let wkt2 = r#"PROJCRS["NAD83 / Texas", BASEGEOGCRS["NAD83", ID["EPSG",4269]], CS[Cartesian,2], ID["EPSG",2277]]"#;
        assert_eq!(Crs::parse(wkt2).unwrap().epsg, Some(2277));
        assert_eq!(Crs::parse("EPSG:31467").unwrap().epsg, Some(31467));
    }

    #[test]
    fn the_horizontal_part_of_a_compound_system_counts() {
        let compound = format!(
            r#"COMPD_CS["both",{UTM},VERT_CS["DHHN2016",VERT_DATUM["x",2005],AUTHORITY["EPSG","7837"]]]"#
        );
        let crs = Crs::parse(&compound).unwrap();
        assert_eq!(crs.epsg, Some(25832));
        assert_eq!(crs.wkt, UTM);
    }

    #[test]
    fn a_system_of_the_users_own_is_its_definition() {
        let own = UTM.replace(",AUTHORITY[\"EPSG\",\"25832\"]]", "]");
        let crs = Crs::parse(&own).unwrap();
        assert_eq!((crs.epsg, crs.text()), (None, own));
    }

    #[test]
    fn local_frames_and_broken_texts_have_none() {
        for text in [
            r#"LOCAL_CS["dam frame",UNIT["metre",1]]"#,
            "",
            "PROJCS[\"open\"",
            "EPSG:",
            "PROJCS[\"a\"]]",
        ] {
            assert_eq!(Crs::parse(text), None, "{text}");
        }
    }
}
