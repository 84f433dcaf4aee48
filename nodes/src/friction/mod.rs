//! Friction sound: spectra measured against sliding speed, and noise synthesised from them.
