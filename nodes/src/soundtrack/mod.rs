//! Soundtracks that follow motion: sound textures by wavelet trees, directed by scores, and scores from motion.
//!
//! # Source
//! Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers: Motion-Driven Sound Synthesis" (SCA 2003).

pub mod matching;
pub mod motion;
pub mod score;
pub mod synthesis;
pub mod wavelet;
