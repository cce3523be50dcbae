// Binds the decoders and encoders of event files.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "events/aedat2.hpp"
#include "events/dat.hpp"
#include "events/dat_writer.hpp"
#include "events/evt2.hpp"
#include "events/evt21.hpp"
#include "events/evt2_writer.hpp"
#include "events/evt3.hpp"
#include "events/evt3_writer.hpp"

namespace jeat::events {

namespace {

using Room = std::tuple<Out<std::int64_t>, Out<std::uint16_t>, Out<std::uint16_t>, Out<std::uint8_t>>;
using EdgeRoom = std::tuple<Out<std::int64_t>, Out<std::uint8_t>, Out<std::uint8_t>>;
using Side = std::pair<std::int64_t, std::int64_t>;

Columns columns_of(const Room& room) {
    const auto& [t, x, y, p] = room;
    check_lengths({t.size(), x.size(), y.size(), p.size()});
    return {span(t), span(x), span(y), span(p)};
}

Triggers triggers_of(const EdgeRoom& room) {
    const auto& [t, channel, value] = room;
    check_lengths({t.size(), channel.size(), value.size()});
    return {span(t), span(channel), span(value)};
}

bool fits(std::int64_t filled, std::size_t room) { return filled >= 0 && static_cast<std::size_t>(filled) <= room; }

// Binds a loop over words of one type; decode(words, state, columns, triggers, limits) -> words used.
template <class Word, class Decode>
void bind_decoder(nb::module_& module, const char* name, const char* doc, Decode decode) {
    module.def(
        name,
        [decode](In<Word> words, DecoderState& state, Room out, EdgeRoom triggers, Side limits) {
            const Columns columns = columns_of(out);
            const Triggers edges = triggers_of(triggers);
            check(fits(state.filled, columns.t.size()), "the state has more events than there is room");
            check(fits(state.triggers, edges.t.size()), "the state has more edges than there is room");
            check(limits.first >= 0 && limits.first <= 1 << 16 && limits.second >= 0 && limits.second <= 1 << 16,
                  "a picture is at most 65536 px wide and high");
            const auto given = span(words);
            // Another thread may use the state meanwhile: the places that are written follow from a copy.
            DecoderState now = state;
            const auto used = [&] {
                const nb::gil_scoped_release release;
                return decode(given, now, columns, edges, Limits{limits.first, limits.second});
            }();
            state = now;
            return used;
        },
        nb::arg("words").noconvert(), nb::arg("state"), nb::arg("out").noconvert(), nb::arg("triggers").noconvert(),
        nb::arg("limits"), doc);
}

// Binds an encoder to words of one type; encode(events, words, state) -> events taken, words written.
template <class Word, class Encode>
void bind_encoder(nb::module_& module, const char* name, const char* doc, Encode encode) {
    module.def(
        name,
        [encode](In<std::int64_t> t, In<std::uint16_t> x, In<std::uint16_t> y, In<std::uint8_t> polarity,
                 Out<Word> words, EncoderState& state) {
            check_lengths({t.size(), x.size(), y.size(), polarity.size()});
            const Events events{span(t), span(x), span(y), span(polarity)};
            const auto room = span(words);
            EncoderState now = state;
            const auto done = [&] {
                const nb::gil_scoped_release release;
                return encode(events, room, now);
            }();
            state = now;
            return done;
        },
        nb::arg("t").noconvert(), nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("polarity").noconvert(),
        nb::arg("words").noconvert(), nb::arg("state"), doc);
}

void bind_states(nb::module_& module) {
    nb::class_<DecoderState>(module, "DecoderState", "What a decoder keeps from block to block of a file.")
        .def(nb::init<>())
        .def_rw("filled", &DecoderState::filled, "Events in the room.")
        .def_rw("triggers", &DecoderState::triggers, "Edges in their room.")
        .def_rw("ended", &DecoderState::ended, "Whether no words follow those that are given.")
        .def_rw("waits", &DecoderState::waits, "Whether the decoder stopped for words that are not there yet.")
        .def_ro("outside", &DecoderState::outside, "Counts, as in `jeat_graph.io.events.reader.Damage`.")
        .def_ro("backwards", &DecoderState::backwards)
        .def_ro("held", &DecoderState::held)
        .def_ro("held_from_us", &DecoderState::held_from_us)
        .def_ro("late_us", &DecoderState::late_us)
        .def_ro("unknown", &DecoderState::unknown)
        .def_ro("untimed", &DecoderState::untimed)
        .def_ro("jumps", &DecoderState::jumps)
        .def_ro("leaps", &DecoderState::leaps);
    nb::class_<EncoderState>(module, "EncoderState", "What an encoder keeps from piece to piece of a recording.")
        .def(nb::init<>());
}

}  // namespace

void bind(nb::module_& module) {
    module.attr("MOST_OF_A_WORD") = MOST_OF_A_WORD;
    module.attr("JUMP_US") = JUMP_US;
    module.attr("LEAP_US") = LEAP_US;
    bind_states(module);
    bind_decoder<std::uint32_t>(module, "decode_evt2", "Decode EVT 2.0; see `jeat_graph.io.events.words.Decode`.",
                                evt2::decode);
    bind_decoder<std::uint64_t>(module, "decode_evt21", "Decode EVT 2.1.", evt21::decode<false>);
    bind_decoder<std::uint64_t>(module, "decode_evt21_swapped", "Decode EVT 2.1, the upper half of each word first.",
                                evt21::decode<true>);
    bind_decoder<std::uint16_t>(module, "decode_evt3", "Decode EVT 3.0.", evt3::decode);
    const auto dat = [](auto loop) {
        return [loop](auto words, DecoderState& state, const Columns& out, const Triggers&, const Limits& limits) {
            return loop(words, state, out, limits);
        };
    };
    bind_decoder<std::uint64_t>(module, "decode_dat", "Decode DAT.", dat(dat::decode<14, 14>));
    bind_decoder<std::uint64_t>(module, "decode_dat_1", "Decode DAT of version 1, of cameras of 304 x 240 px.",
                                dat(dat::decode<9, 8>));
    bind_decoder<std::uint64_t>(module, "decode_aedat2_davis", "Decode AEDAT 2.0 of a DAVIS.", aedat2::decode<true>);
    bind_decoder<std::uint64_t>(module, "decode_aedat2_dvs128", "Decode AEDAT 2.0 of a DVS128.", aedat2::decode<false>);
    bind_encoder<std::uint32_t>(module, "encode_evt2", "Encode EVT 2.0; see `jeat_graph.io.events.word_writer.Encode`.",
                                evt2::encode);
    bind_encoder<std::uint16_t>(module, "encode_evt3", "Encode EVT 3.0.", evt3::encode);
    bind_encoder<std::uint64_t>(
        module, "encode_dat", "Encode DAT.",
        [](const Events& events, std::span<std::uint64_t> words, EncoderState&) { return dat::encode(events, words); });
}

}  // namespace jeat::events
