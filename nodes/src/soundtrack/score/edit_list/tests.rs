use super::*;

const CMX: &str = "TITLE: RECUT
FCM: NON-DROP FRAME

001  AX       V     C        01:00:02:00 01:00:04:12 00:00:00:00 00:00:02:12
* FROM CLIP NAME: Street
M2   AX             050.0    01:00:02:00
002  TAPE01   V     C        00:00:10:00 00:00:10:00 00:00:02:12 00:00:02:12
* FROM CLIP NAME: Street
002  TAPE02   AA/V  D    012 00:00:20:00 00:00:21:00 00:00:02:12 00:00:03:12
* TO CLIP NAME: Car
003  BL       V     C        00:00:00:00 00:00:01:00 00:00:03:12 00:00:04:12
* FROM CLIP NAME: Nothing
004  AX       A2    C        00:00:00:00 00:00:01:00 00:00:03:12 00:00:04:12
005  AX       B     W001 010 00:00:30:00 00:00:30:10 00:00:04:12 00:00:05:12
006  AX       V     C        00:00:31:00 00:00:31:00 00:00:05:12 00:00:06:12
BLAH
";

fn edits(text: &str) -> EditList {
    read_edits(text.as_bytes(), 25.0).unwrap()
}

fn error(text: &str, fps: f64) -> String {
    read_edits(text.as_bytes(), fps).unwrap_err().to_string()
}

/// A CMX list of one event with the given source timecodes.
fn one(times: &str) -> String {
    format!("001 AX V C {times} 00:00:00:00 00:00:01:00\n")
}

#[test]
fn the_events_with_picture_of_a_cmx_list_are_edits() {
    for text in [CMX.to_owned(), CMX.replace('\n', "\r\n"), CMX.replace('\n', "\r"), format!("\u{feff}{CMX}")]
    {
        let list = edits(&text);
        let found: Vec<(&str, u32)> = list.edits.iter().map(|edit| (edit.name.as_str(), edit.line)).collect();
        assert_eq!(found, [("Street", 4), ("Car", 9), ("edit 005", 14)]);
        assert_eq!((list.edits[0].source, list.edits[0].target), ((3602.0, 3604.48), (0.0, 2.48)));
        assert_eq!((list.edits[1].source, list.edits[1].target), ((20.0, 21.0), (2.48, 3.48)));
        assert_eq!(
            list.notices,
            [
                "line 16: no event, comment or known keyword: ignored",
                "line 6: M2, a change of speed, is ignored",
                "line 13: sound without picture is ignored, since the list has picture",
                "lines 9, 14: a dissolve, wipe or key is read as a cut at its beginning",
                "2 reels (AX, TAPE02) are read as times of the first recording",
                "line 15: the source has the length 0, as a freeze frame has, and no sound: left out",
                "line 14: the picture has another speed than its source; source and target keep their lengths",
            ]
        );
    }
}

#[test]
fn a_list_of_sound_alone_has_one_edit_for_all_channels() {
    let text = "001 AX A  C 00:00:02:00 00:00:03:00 00:00:00:00 00:00:01:00\n\
        002 AX A2 C 00:00:02:00 00:00:03:00 00:00:00:00 00:00:01:00\n\
        003 AX AA C 00:00:05:00 00:00:06:00 00:00:01:00 00:00:02:00\n";
    let lines: Vec<u32> = edits(text).edits.iter().map(|edit| edit.line).collect();
    assert_eq!(lines, [1, 3]);
}

#[test]
fn drop_frame_timecode_leaves_out_two_numbers_a_minute_but_every_tenth() {
    let start = |fcm: &str, from: &str, to: &str, fps: f64| {
        let text = format!("FCM: {fcm}\n{}", one(&format!("{from} {to}")));
        read_edits(text.as_bytes(), fps).unwrap().edits[0].source.0
    };
    let frame = 1001.0 / 30_000.0;
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    close(start("DROP FRAME", "00:01:00;02", "00:01:01;00", 29.97), 1800.0 * frame);
    close(start("NON-DROP FRAME", "00:00:59;29", "00:01:01;00", 29.97), 1799.0 * frame);
    close(start("DROP FRAME", "00:10:00:00", "00:10:01:00", 29.97), 17_982.0 * frame);
    close(start("NON-DROP FRAME", "00:10:00:00", "00:10:01:00", 29.97), 18_000.0 * frame);
    close(start("DROP FRAME", "01:00:00;00", "01:00:01;00", 59.94), 215_784.0 * 1001.0 / 60_000.0);
    close(start("NON-DROP FRAME", "00:00:01:12", "00:00:02:00", 23.98), 36.0 * 1001.0 / 24_000.0);
    // Timecodes with colons beside others with semicolons count all numbers.
    let mixed = "FCM: DROP FRAME\n001 AX V C 00:10:00:00 00:10:01:00 00:10:00;00 00:10:01;00\n";
    let edit = read_edits(mixed.as_bytes(), 29.97).unwrap().edits[0].clone();
    close(edit.source.0, 18_000.0 * frame);
    close(edit.target.0, 17_982.0 * frame);
}

#[test]
fn errors_of_a_cmx_list_have_line_and_column() {
    for (text, fps, part) in [
        ("", 25.0, "1:1: found \"\"; an event such as `001 AX V C"),
        ("\nRIFF\n", 25.0, "2:1: found \"RIFF\"; an event"),
        ("001 AX V C 00:00:00:00\n", 25.0, "1:1: found \"001 AX V C 00:00:00:00\"; an event"),
        (
            &one("00:00:00:25 00:00:02:00"),
            25.0,
            "1:12: \"00:00:00:25\"; a timecode from 00:00:00:00 to 23:59:59:24",
        ),
        (&one("00:00:00:00 00:60:02:00"), 25.0, "1:24: \"00:60:02:00\""),
        (&one("00:00:00:00 2.5"), 25.0, "1:24: \"2.5\"; a timecode"),
        (&one("00:00:02:00 00:00:01:00"), 25.0, "1:24: the source ends at 00:00:01:00, before it begins"),
        (&one("00:00:00;00 00:00:01;00"), 25.0, "`fps` of 29.97 or 59.94 is needed"),
        (&one("00:00:00;00 00:00:01;00"), 30.0, "drop-frame timecode at 30 frames per second"),
        (&one("00:01:00;01 00:01:01;00"), 29.97, "leaves this number out"),
        (&one("00:00:00:00 00:00:01:00").replace(" C ", " X "), 25.0, "1:10: the transition \"X\"; C, D,"),
        (&one("x 00:00:00:00 00:00:01:00"), 25.0, "1:12: found \"x\"; a length in frames"),
        (&one("00:00:01:00 00:00:01:00"), 25.0, "1:1: the list has no edit"),
    ] {
        let e = error(text, fps);
        assert!(e.contains(part), "{text}: {e}");
    }
}

fn rational(value: f64, rate: f64) -> String {
    format!(r#"{{"OTIO_SCHEMA": "RationalTime.1", "rate": {rate:?}, "value": {value:?}}}"#)
}

fn range(from: f64, duration: f64) -> String {
    let [from, duration] = [from, duration].map(|x| rational(x, 24.0));
    format!(r#"{{"OTIO_SCHEMA": "TimeRange.1", "duration": {duration}, "start_time": {from}}}"#)
}

/// An item of a timeline, on a line of its own.
fn item(schema: &str, name: &str, fields: &str) -> String {
    format!(
        "{{\"OTIO_SCHEMA\": \"{schema}\", \"metadata\": {{\"children\": [{{}}]}}, \"name\": \"{name}\", {fields}}}"
    )
}

fn timeline(items: &[String]) -> String {
    format!(
        "{{\"OTIO_SCHEMA\": \"Timeline.1\", \"name\": \"say \\\"{{\\\"\", \"global_start_time\": null, \"tracks\":\n{{\
         \"OTIO_SCHEMA\": \"Stack.1\", \"source_range\": null, \"children\": [\n\
         {{\"OTIO_SCHEMA\": \"Track.1\", \"kind\": \"Audio\", \"children\": [{{\"OTIO_SCHEMA\": \"Gap.1\"}}]}},\n\
         {{\"OTIO_SCHEMA\": \"Track.1\", \"kind\": \"Video\", \"name\": \"V1\", \"source_range\": null, \"children\": [\n{}\n]}}]}}}}",
        items.join(",\n")
    )
}

#[test]
fn the_video_track_of_a_timeline_is_read_with_gaps_and_available_ranges() {
    let url = |name: &str| {
        format!(r#""media_reference": {{"target_url": "{name}", "available_range": {}}}"#, range(240.0, 48.0))
    };
    let retimed = r#""effects": [{"OTIO_SCHEMA": "LinearTimeWarp.1", "time_scalar": 2.0, "name": null}]"#;
    let text = timeline(&[
        item("Clip.1", "one", &format!(r#""source_range": {}"#, range(120.0, 24.0))),
        item("Transition.1", "", r#""transition_type": "SMPTE_Dissolve""#),
        item("Gap.1", "", &format!(r#""source_range": {}"#, range(0.0, 12.0))),
        item("Clip.2", "two", &format!(r#""source_range": null, {}"#, url("a.mov"))),
        item("Clip.2", "off", &format!(r#""enabled": false, "source_range": {}"#, range(0.0, 24.0))),
        item(
            "Clip.2",
            "",
            &format!(
                r#""source_range": {}, {retimed}, "active_media_reference_key": "hi", "media_references": {{"hi": {{"target_url": "b.mov"}}}}"#,
                range(6.0, 6.0)
            ),
        ),
    ]);
    let list = edits(&text);
    let found: Vec<(&str, u32)> = list.edits.iter().map(|edit| (edit.name.as_str(), edit.line)).collect();
    assert_eq!(found, [("one", 5), ("two", 8), ("edit 003", 10)]);
    let times: Vec<_> = list.edits.iter().map(|edit| (edit.source, edit.target)).collect();
    assert_eq!(times, [((5.0, 6.0), (0.0, 1.0)), ((10.0, 12.0), (1.5, 3.5)), ((0.25, 0.5), (4.5, 4.75))]);
    assert_eq!(
        list.notices,
        [
            "line 6: a transition is read as the cut in its middle",
            "line 10: a change of speed is ignored",
            "of 2 tracks the one at 1, \"V1\", is read",
            "2 media files are read as times of the first recording",
        ]
    );
}

#[test]
fn errors_of_a_timeline_name_the_item() {
    let clip = |fields: &str| timeline(&[item("Clip.1", "a", fields)]);
    for (text, part) in [
        ("{".to_owned(), "1:1: EOF while parsing"),
        ("{\n\"tracks\": 3}".to_owned(), "2:11: invalid type: integer `3`"),
        ("{}".to_owned(), "found \"no OTIO_SCHEMA\"; a file with one Timeline.1 is needed"),
        ("{\"OTIO_SCHEMA\": \"SerializableCollection.1\"}".to_owned(), "found \"SerializableCollection.1\""),
        ("{\"OTIO_SCHEMA\": \"Timeline.1\"}".to_owned(), "no Track.1"),
        (timeline(&[]), "the list has no edit"),
        (
            timeline(&[item("Stack.1", "", r#""children": []"#)]),
            "5:1: tracks.children[1].children[0]: found a nested stack",
        ),
        (
            timeline(&[item("Marker.2", "", r#""color": "RED""#)]),
            "5:1: tracks.children[1].children[0]: found \"Marker\"",
        ),
        (clip(r#""source_range": null"#), "neither a source_range nor an available_range"),
        (clip(&format!(r#""source_range": {}"#, range(0.0, -1.0))), "has the duration -1/24"),
        (clip(&format!(r#""source_range": {}"#, range(0.0, 24.0))).replace("24.0", "0.0"), "rates above 0"),
        (
            clip(&format!(r#""source_range": {}"#, range(0.0, 24.0))).replace("value", "count"),
            "missing field `value`",
        ),
        (
            timeline(&[]).replace(
                "\"V1\", \"source_range\": null",
                &format!("\"V1\", \"source_range\": {}", range(0.0, 1.0)),
            ),
            "track 1 has a source_range",
        ),
    ] {
        let e = error(&text, 25.0);
        assert!(e.contains(part), "{text}: {e}");
    }
}

#[test]
fn tables_have_their_columns_in_any_order() {
    let text = "# by hand\nsource_from, source_to,target_from,target_to,weight,recording\n1,2,10,11,,\n3,4.5,11,12.5,-0.5,b.wav\n";
    let list = edits(text);
    let want = Edit {
        target: (11.0, 12.5),
        source: (3.0, 4.5),
        name: "edit 002".into(),
        recording: Some("b.wav".into()),
        weight: Some(-0.5),
        line: 4,
    };
    assert_eq!((&list.edits[1], list.edits[0].weight, &list.edits[0].recording), (&want, None, &None));
    for (text, part) in [
        ("target_from,target_to,source_from\n", "1:1: there is no column `source_to`; columns are"),
        ("target_from,target_to,source_from,source_to,gain\n", "there is no column \"gain\""),
        ("target_from,target_to,source_from,source_to,weight,weight\n", "`weight` occurs twice"),
        ("target_from,target_to,source_from,source_to\n", "the list has no edit"),
        ("target_from,target_to,source_from,source_to\n0,1,2\n", "2:1: 3 field(s)"),
        (
            "target_from,target_to,source_from,source_to\n0,1,2,x\n",
            "2:1: column `source_to`: \"x\"; a number from 0 to 86400",
        ),
        ("target_from,target_to,source_from,source_to\n0,1,2,inf\n", "\"inf\""),
        ("target_from,target_to,source_from,source_to\n1,1,2,3\n", "2:1: the target is from 1 s to 1 s"),
        ("target_from,target_to,source_from,source_to\n1,2,3,2\n", "the source is from 3 s to 2 s"),
        (
            "target_from,target_to,source_from,source_to,weight\n0,1,2,3,1.5\n",
            "column `weight`: \"1.5\"; a number from -1 to 1",
        ),
    ] {
        let e = error(text, 25.0);
        assert!(e.contains(part), "{text}: {e}");
    }
}

#[test]
fn a_score_has_a_sound_for_each_interval_and_a_target_for_each_edit() {
    let edit = |target: (f64, f64), source: (f64, f64), name: &str| Edit {
        target,
        source,
        name: name.into(),
        line: 7,
        ..Edit::default()
    };
    let mut edits = vec![
        edit((12.0, 13.0), (0.25, 1.25), "a"),
        edit((10.0, 12.0), (4.0, 6.0), "a"),
        edit((13.0, 14.0), (0.25, 1.25), "b"),
        edit((14.0, 15.0), (0.25, 1.25), "a 2"),
    ];
    edits[3].recording = Some("b.wav".into());
    edits[3].weight = Some(-1.0);
    let rules = EditRules { av_offset: -0.5, weight: 0.75, ..EditRules::default() };
    let score = edits_to_score(&edits, &rules).unwrap();
    let names: Vec<&str> = score.sources.iter().map(|source| source.name.as_str()).collect();
    assert_eq!(names, ["a", "a 2", "a 2 2"]);
    assert_eq!(
        (&score.sources[0].segments, &score.sources[1].segments),
        (&vec![(0.0, 0.75)], &vec![(3.5, 5.5)])
    );
    let sources: Vec<usize> = score.targets.iter().flat_map(|target| target.sources.clone()).collect();
    assert_eq!((sources.as_slice(), score.duration), ([0, 1, 0, 2].as_slice(), Some(5.0)));
    assert_eq!(score.targets[1].curve, WeightCurve::constant(0.0, 2.0, 0.75));
    assert_eq!(score.targets[3].curve, WeightCurve::constant(4.0, 5.0, -1.0));
    assert_eq!(score.targets[3].location, Location { line: 7, column: 1 });
    // What is written is a valid score.
    let text = super::super::text::write_score(&score, &[]);
    assert_eq!(super::super::text::read_score(&text).unwrap().targets.len(), 4);

    let rules = EditRules { source_start: 0.25, from_zero: false, ..EditRules::default() };
    let score = edits_to_score(&edits, &rules).unwrap();
    assert_eq!((score.sources[0].segments[0], score.targets[0].curve.points[0].0), ((0.0, 1.0), 12.0));
    for (rules, part) in [
        (EditRules { source_start: 0.5, ..rules }, "line 7: the source begins at 0.25 s, before the start"),
        (EditRules { av_offset: -2.0, ..rules }, "line 7: with `av_offset` the source ends at -1 s"),
        (EditRules { av_offset: 1e6, ..rules }, "line 7: the source is from"),
        (EditRules { av_offset: f64::NAN, ..rules }, "an interval from 0 s to 86400 s"),
        (EditRules { weight: 2.0, ..rules }, "line 7: the weight is 2; a number from -1 to 1"),
    ] {
        let e = edits_to_score(&edits, &rules).unwrap_err();
        assert!(e.contains(part), "{e}");
    }
}

#[test]
fn damaged_lists_are_errors_or_lists_but_never_panics() {
    let otio = timeline(&[item("Clip.1", "one", &format!(r#""source_range": {}"#, range(120.0, 24.0)))]);
    let table = "target_from,target_to,source_from,source_to\n0,1,2,3\n";
    for text in [CMX, otio.as_str(), table] {
        for end in 0..text.len() {
            let mut files = vec![text.as_bytes()[..end].to_vec()];
            files.extend([0, b'\n', b' ', b'{', b'"', b':', b'9', b'-', 0xff].map(|byte| {
                let mut bytes = text.as_bytes().to_vec();
                bytes[end] = byte;
                bytes
            }));
            for file in files {
                if let Ok(list) = read_edits(&file, 29.97) {
                    drop(edits_to_score(&list.edits, &EditRules::default()));
                }
            }
        }
    }
}

#[test]
fn long_lists_are_read_in_linear_time() {
    let mut text = String::from("target_from,target_to,source_from,source_to\n");
    for k in 0..100_001 {
        text += &format!("{},{},{},{}\n", f64::from(k) * 0.5, f64::from(k) * 0.5 + 0.5, k / 4, k / 4 + 1);
    }
    assert!(error(&text, 25.0).contains("100001 edits; at most 100000 are read"));
    let (text, _) = text.trim_end().rsplit_once('\n').unwrap();
    let mut list = edits(text);
    list.edits.iter_mut().for_each(|edit| edit.name = "same".into());
    assert_eq!(edits_to_score(&list.edits, &EditRules::default()).unwrap().sources.len(), 25_000);
}
