#!/bin/sh
# Makes the tone files of tests/data with SoX, LAME, FFmpeg, vorbis-tools and flac. Run inside tests/data.
# Channel c of every file is 0.5 sin(2 pi 1000 (c + 1) n / rate); 5000 frames (6000 at 44.1 kHz, 160000 in the long one of several pages).
set -e
t=$(mktemp -d)
sox -D -r 22050 -n -c 1 -b 16 "$t/mono.wav" synth 5000s sine 1000 gain -6
sox -D -r 44100 -n -c 2 -b 16 "$t/stereo.wav" synth 6000s sine 1000 sine 2000 gain -6
sox -D -r 48000 -n -c 1 -b 24 "$t/mono24.wav" synth 5000s sine 1000 gain -6
lame --quiet -b 64 "$t/mono.wav" tone_22050_1.mp3
lame --quiet -b 48 -t "$t/mono.wav" untagged_22050_1.mp3
ffmpeg -v error -y -i "$t/stereo.wav" -c:a libmp3lame -b:a 96k tone_44100_2.mp3
oggenc -Q -q 5 "$t/stereo.wav" -o tone_44100_2.ogg
sox -D -r 44100 -n -c 2 -b 16 "$t/long.wav" synth 160000s sine 1000 sine 2000 gain -6
sox -D "$t/long.wav" -C 0 long_44100_2.ogg
oggenc -Q -q 5 "$t/mono.wav" -o tone_22050_1.ogg
flac --totally-silent -f --no-padding --no-seektable --blocksize=1024 "$t/mono.wav" -o tone_22050_1.flac
flac --totally-silent -f --no-padding --blocksize=1024 "$t/mono24.wav" -o tone_48000_1_24bit.flac
rm -r "$t"
