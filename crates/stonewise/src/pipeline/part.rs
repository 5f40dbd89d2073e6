//! Parts of steps, which other processes may do.

/// A part of a step, or what gathers the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// What all others need.
    Prepare,
    /// One photo, counted from 0.
    Photo(usize),
    /// One batch of tiles, counted from 0, and how many there are.
    Tiles(usize, usize),
    /// The step itself, from this number of parts.
    Whole(usize),
}

impl Part {
    /// Its name, in that of the unit and of its folder.
    pub fn name(self) -> String {
        match self {
            Self::Prepare => self.kind().to_owned(),
            Self::Photo(number) => format!("{number:05}"),
            Self::Tiles(number, count) => format!("{:03}of{count:03}", number + 1),
            Self::Whole(_) => String::new(),
        }
    }

    /// Which kind of part it is, in the stage of the unit.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Prepare => "prepare",
            Self::Photo(_) => "photo",
            Self::Tiles(..) => "tiles",
            Self::Whole(_) => "",
        }
    }
}
