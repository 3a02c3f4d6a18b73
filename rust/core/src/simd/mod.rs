//! Numbers over SIMD lanes: one frequency line a lane.

pub mod elementary;
pub mod lane;
pub mod small;
