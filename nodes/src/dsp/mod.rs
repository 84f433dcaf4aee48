//! Filters, gains, delays, resampling and signal sources on audio.
