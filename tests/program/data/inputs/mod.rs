//! Images as they come: turned, in several formats, with colour profiles and in several depths.

mod colour;
mod depth;
mod formats;
mod light;
mod orientation;
mod video_colours;
