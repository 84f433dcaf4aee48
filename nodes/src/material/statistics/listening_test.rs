//! Stimuli and form of a listening test, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::{MemoryFiles, WriteSeek};
use crate::core::node::{Class, Node, Summary, same_rate};
use crate::core::params::{AssetPath, OutPath, Text};
use crate::core::ports::{Many, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{Weighting, db_to_linear, weighted_rms};
use crate::io::text_output::TextOutput;
use crate::io::wav_out::wav_rate;
use crate::io::{AudioWriter, MaxLength, RecordingParam, WriteFormat, WriteSpec};
use crate::{archive_state, params, ports};
use serde_json::json;
use std::collections::HashSet;

/// Longest sound, s.
const LONGEST: f64 = 30.0;
/// Duration over which a level is measured, s: the time constant `Fast` of a sound level meter.
const WINDOW: f64 = 0.125;
/// Greatest sample of a stimulus, full scale.
const HIGHEST_PEAK: f64 = 0.9;

params! {
    /// Writes the stimuli of a listening test on materials, and an HTML form that plays them in pairs and saves the ratings.
    ///
    /// The sounds are those of each object in each material by each set of materials: all sets of the first material on the first object,
    /// those of the next material, and so on; then the next object. The node writes each as a WAV beside the form, named after the three, and
    /// so the recordings. All have one A-weighted level in their loudest 125 ms, unless their peak would exceed 0.9.
    ///
    /// The form needs a browser only, and sends nothing. It presents pairs of a recording and a sound, half of one material and half of different
    /// ones, which depend on the name of the subject. It saves a CSV that `RatingStatistics` reads.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 6.1.
    pub struct ListeningTestParams {
        /// Names of the objects.
        objects: Vec<Text>;
        /// Names of the materials.
        materials: Vec<Text>;
        /// Names of the sets of materials, such as damping models.
        sets: Vec<Text>;
        /// Recordings of struck objects, of at most 30 s each; channels are averaged.
        recordings: Vec<AssetPath> = vec![];
        /// Material of each recording.
        recorded: Vec<Text> = vec![];
        /// Number of pairs that a subject rates.
        pairs: usize = 20, unit "", range 1..=1000;
        /// A-weighted level of each sound.
        level: f64 = -26.0, unit "dB", range -80.0..=0.0;
        /// HTML file of the form.
        form: OutPath;
    }
}
ports! {
    pub struct ListeningTestPorts / ListeningTestIo {
        in {
            /// The sounds, each with an end, at one sample rate; channels are averaged.
            sounds: Many<Stream<f32>>,
        }
        out {}
    }
}

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F077", max: MaxLength::Seconds(LONGEST as u64) };

/// A sound of the form: its file and its label.
struct Stimulus {
    file: String,
    object: String,
    material: String,
    set: String,
    rate: u32,
    samples: Vec<f32>,
    output: Box<dyn WriteSeek>,
}

/// The node `ListeningTest`.
pub struct ListeningTest {
    name: String,
    sets: Vec<String>,
    pairs: usize,
    level: f64,
    rate: Rate,
    recordings: Vec<Stimulus>,
    stimuli: Vec<Stimulus>,
    /// The sound of each stimulus so far.
    sounds: Vec<Vec<f32>>,
    form: TextOutput,
}

/// Letters, digits and hyphens of a name in small letters, with `_` for the rest.
fn slug(name: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() || c == '-' { c } else { '_' };
    name.to_lowercase().chars().map(letter).collect()
}

fn check_names(field: &'static str, names: &[Text]) -> Result<(), Reject> {
    if names.is_empty() {
        return Err(Reject::new("F051", format!("`{field}` is empty"))
            .at(field)
            .help("give a name at least"));
    }
    let mut found = HashSet::new();
    let again = names.iter().position(|name| name.0.trim().is_empty() || !found.insert(slug(&name.0)));
    again.map_or(Ok(()), |k| {
        let message = format!("{:?} is empty, or the same file name as an earlier one", names[k].0);
        Err(Reject::new("F051", message).at(format!("{field}[{k}]")).help("give each a name of its own"))
    })
}

/// Object, material and set of each sound.
fn labels(p: &ListeningTestParams) -> Vec<[&str; 3]> {
    let sets = |object, material| {
        p.sets.iter().map(move |set: &Text| -> [&str; 3] { [object, material, set.0.as_str()] })
    };
    let materials = |object| p.materials.iter().flat_map(move |m: &Text| sets(object, m.0.as_str()));
    p.objects.iter().flat_map(|object| materials(object.0.as_str())).collect()
}

/// Greatest A-weighted level of any 125 ms, as an RMS of full scale.
fn loudest(samples: &[f32], rate: f64) -> f64 {
    let window = ((WINDOW * rate) as usize).max(1);
    let starts = (0..samples.len()).step_by((window / 2).max(1));
    // A shorter rest counts as if silence followed.
    let levels = starts.map(|start| {
        let part = &samples[start..(start + window).min(samples.len())];
        weighted_rms(part, rate, Weighting::A) * (part.len() as f64 / window as f64).sqrt()
    });
    levels.fold(0.0, f64::max)
}

impl Stimulus {
    /// Scales the sound to a level, or less where it would clip, and writes it; returns true if it is silent.
    fn write(&mut self, level: f64) -> Result<bool, Fault> {
        let found = loudest(&self.samples, f64::from(self.rate));
        let peak = self.samples.iter().fold(0.0, |peak: f64, &x| peak.max(f64::from(x).abs()));
        let silent = found <= 0.0;
        if !silent {
            let gain = (db_to_linear(level) / found).min(HIGHEST_PEAK / peak);
            self.samples.iter_mut().for_each(|x| *x = (f64::from(*x) * gain) as f32);
        }
        let fault = |e: &dyn std::fmt::Display| {
            Fault::new("F080", format!("cannot write {:?}: {e}", self.file)).at("form")
        };
        let spec = WriteSpec::new(self.rate, 1, WriteFormat::Pcm24);
        let mut writer = AudioWriter::new(&mut self.output, spec).map_err(|e| fault(&e))?;
        writer.write(&self.samples).map_err(|e| fault(&e))?;
        writer.finish().map_err(|e| fault(&e))?;
        Ok(silent)
    }
}

impl Node for ListeningTest {
    type Params = ListeningTestParams;
    type Ports = ListeningTestPorts;
    const NAME: &'static str = "ListeningTest";
    const CLASS: Class = Class::Offline;

    fn shape(p: &ListeningTestParams, s: &mut Shape<'_, '_, ListeningTestPorts>) -> Result<(), Reject> {
        for (field, names) in [("objects", &p.objects), ("materials", &p.materials), ("sets", &p.sets)] {
            s.check(check_names(field, names));
        }
        let sounds = s.many(ListeningTestPorts::sounds);
        let (o, m, n) = (p.objects.len(), p.materials.len(), p.sets.len());
        if sounds.len() != o * m * n {
            let message = format!(
                "{} sounds are linked; {o} object(s) in {m} material(s) by {n} set(s) have {}",
                sounds.len(),
                o * m * n
            );
            s.wrong(Reject::new("F051", message).at("sounds"));
        }
        if p.recorded.len() != p.recordings.len() {
            let message = format!("{} materials for {} recording(s)", p.recorded.len(), p.recordings.len());
            s.wrong(Reject::new("F051", message).at("recorded").help("give one for each"));
        }
        if let Some(first) = sounds.first() {
            s.check(wav_rate("sounds", first.rate));
        }
        for (k, input) in sounds.iter().enumerate() {
            let field = format!("sounds[{k}]");
            s.check(same_rate(&field, input.rate, "`sounds[0]`", sounds[0].rate));
            if input.end.is_none_or(|end| crate::core::time::seconds(end) > LONGEST) {
                s.note(format!("`sounds[{k}]` may be longer than {LONGEST} s, and is cut there"));
            }
        }
        RECORDINGS.check(s, &p.recordings);
        for material in p.materials.iter().filter(|m| !p.recorded.contains(m)) {
            s.note(format!("there is no recording of {:?}: no pair is of one material with it", material.0));
        }
        Ok(())
    }

    fn build(p: &ListeningTestParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.many(ListeningTestPorts::sounds).first().map_or(Rate::hz(44_100), |i| i.rate);
        let (folder, name) = p.form.0.rsplit_once('/').map_or(("", p.form.0.as_str()), |(f, n)| (f, n));
        let create = |file: &str| {
            let path = if folder.is_empty() { file.to_owned() } else { format!("{folder}/{file}") };
            cx.create("form", &path)
        };
        let mut recordings = Vec::new();
        for (k, (path, material)) in p.recordings.iter().zip(&p.recorded).enumerate() {
            let (samples, info) = RECORDINGS.read_mono(cx, &path.0)?;
            let file = format!("recording_{}_{}.wav", k + 1, slug(&material.0));
            let (output, rate) = (create(&file)?, info.rate);
            let (object, set, material) = (String::new(), String::new(), material.0.clone());
            recordings.push(Stimulus { file, object, material, set, rate, samples, output });
        }
        let stimulus = |[object, material, set]: [&str; 3]| {
            let file = format!("{}_{}_{}.wav", slug(object), slug(material), slug(set));
            let output = create(&file)?;
            let [object, material, set] = [object, material, set].map(str::to_owned);
            let rate = rate.as_f64().round() as u32;
            Ok(Stimulus { file, object, material, set, rate, samples: Vec::new(), output })
        };
        let stimuli = labels(p).into_iter().map(stimulus).collect::<Result<Vec<_>, Fault>>()?;
        Ok(Self {
            name: name.to_owned(),
            sets: p.sets.iter().map(|set| set.0.clone()).collect(),
            pairs: p.pairs,
            level: p.level,
            rate,
            recordings,
            sounds: vec![Vec::new(); stimuli.len()],
            stimuli,
            form: TextOutput::create(cx, "form", &p.form)?,
        })
    }

    fn run(&mut self, io: ListeningTestIo<'_>) -> Result<(), Fault> {
        let longest = (LONGEST * self.rate.as_f64()) as usize;
        for (sound, input) in self.sounds.iter_mut().zip(io.sounds.iter()) {
            let width = input.width().max(1);
            let left = longest - sound.len();
            let frames = input.items().chunks_exact(width).take(left);
            let mean = |frame: &[f32]| frame.iter().map(|x| f64::from(*x)).sum::<f64>() / width as f64;
            sound.extend(frames.map(|frame| mean(frame) as f32));
        }
        Ok(())
    }

    fn finish(&mut self, _: ListeningTestIo<'_>) -> Result<Summary, Fault> {
        for (stimulus, sound) in self.stimuli.iter_mut().zip(&mut self.sounds) {
            stimulus.samples = std::mem::take(sound);
        }
        let mut silent = Vec::new();
        for stimulus in self.recordings.iter_mut().chain(&mut self.stimuli) {
            if stimulus.write(self.level)? {
                silent.push(stimulus.file.clone());
            }
        }
        let describe =
            |s: &Stimulus| json!({"file": s.file, "object": s.object, "material": s.material, "set": s.set});
        let test = json!({
            "name": self.name,
            "pairs": self.pairs,
            "sets": self.sets,
            "sounds": self.stimuli.iter().map(describe).collect::<Vec<_>>(),
            "recordings": self.recordings.iter().map(describe).collect::<Vec<_>>(),
        });
        // A name that holds the end of the script must not end it.
        let test = test.to_string().replace('<', "\\u003c");
        let mut summary = vec![
            ("sounds", self.stimuli.len().into()),
            ("recordings", self.recordings.len().into()),
            ("level_db", self.level.into()),
        ];
        self.form.write(&include_str!("listening_test.html").replace("{{TEST}}", &test), &mut summary)?;
        summary.extend(silent.into_iter().map(|file| ("warning", format!("{file:?} is silent").into())));
        Ok(summary)
    }

    archive_state!(sounds);

    fn trial(_: &mut Rng) -> (ListeningTestParams, MemoryFiles) {
        let one = |name: &str| vec![Text(name.to_owned())];
        let params = ListeningTestParams {
            objects: one("vase"),
            materials: one("glass"),
            sets: one("hybrid"),
            recordings: Vec::new(),
            recorded: Vec::new(),
            pairs: 20,
            level: -26.0,
            form: OutPath("form.html".into()),
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::dsp::linear_to_db;
    use crate::io::{AudioReader, trial_wav};
    use crate::material::statistics::ratings::read_ratings;

    fn params(sets: &[&str]) -> ListeningTestParams {
        let texts = |names: &[&str]| names.iter().map(|n| Text((*n).to_owned())).collect::<Vec<_>>();
        ListeningTestParams {
            objects: texts(&["A vase", "bowl"]),
            materials: texts(&["glass"]),
            sets: texts(sets),
            recordings: vec![AssetPath("hit.wav".into())],
            recorded: texts(&["glass"]),
            pairs: 4,
            level: -30.0,
            form: OutPath("test/form.html".into()),
        }
    }

    fn decaying(amplitude: f32) -> Vec<f32> {
        let wave = |k: usize| (k as f32 * 0.3).sin() * (-(k as f32) / 4000.0).exp();
        (0..16_000).map(|k| amplitude * wave(k)).collect()
    }

    fn linked(p: ListeningTestParams, sounds: usize) -> Standalone {
        let mut base = Standalone::new::<ListeningTest>(p);
        base.files.insert("hit.wav", trial_wav(&decaying(0.5), 8000));
        (0..sounds).fold(base, |base, k| {
            let sound = decaying(0.01 * (k + 1) as f32);
            base.also(ListeningTestPorts::sounds, Rate::hz(8000), Channels(1), sound)
        })
    }

    #[test]
    fn all_stimuli_have_one_level() {
        let node = linked(params(&["hybrid", "</script>"]), 4);
        node.run().unwrap();
        let names =
            ["a_vase_glass_hybrid", "a_vase_glass___script_", "bowl_glass_hybrid", "recording_1_glass"];
        for name in names {
            let bytes = node.outputs.get(&format!("test/{name}.wav")).unwrap_or_else(|| panic!("no {name}"));
            let samples =
                AudioReader::open(Box::new(std::io::Cursor::new(bytes))).unwrap().read_mono().unwrap();
            let level = linear_to_db(loudest(&samples, 8000.0));
            assert!((level + 30.0).abs() < 0.02, "{name}: {level} dB");
        }
        let form = String::from_utf8(node.outputs.get("test/form.html").unwrap()).unwrap();
        assert!(form.contains(r#""file":"bowl_glass_hybrid.wav""#) && !form.contains("{{"));
        // The set's name does not end the script.
        assert_eq!(form.matches("</script>").count(), 1);
    }

    #[test]
    fn sounds_and_names_must_match() {
        let field = |p, sounds| linked(p, sounds).shape().unwrap_err().field;
        assert_eq!(field(params(&["hybrid"]), 3).as_deref(), Some("sounds"));
        assert_eq!(field(params(&["hybrid", "Hybrid"]), 4).as_deref(), Some("sets[1]"));
        let recorded = ListeningTestParams { recorded: Vec::new(), ..params(&["hybrid"]) };
        assert_eq!(field(recorded, 2).as_deref(), Some("recorded"));
    }

    #[test]
    fn ratings_of_several_subjects_are_read_from_joined_files() {
        let header = "subject,set,pair,rating,recorded_material,material,object,recording,sound\n";
        let row = |pair, rating| {
            format!("\"a\",\"hybrid\",{pair},{rating},\"glass\",\"glass\",\"vase\",\"r.wav\",\"s.wav\"\n")
        };
        let file = format!("{header}{}{header}{}", row("same", 9), row("different", 2));
        let sets = read_ratings(file.as_bytes()).unwrap();
        assert_eq!(
            (sets[0].same.as_slice(), sets[0].different.as_slice()),
            ([9.0].as_slice(), [2.0].as_slice())
        );
    }
}
