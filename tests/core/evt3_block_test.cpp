// Looking at 64 words of EVT 3.0 at once gives what looking at them one by one gives; run by .ci/sanitize.
#include <cstdio>
#include <random>
#include <vector>

#include "events/evt3_block.hpp"

using namespace jeat::events::evt3;

namespace {

bool equal(const Block& one, const Block& other) {
    if (one.row != other.row || one.first != other.first || one.emit != other.emit || one.plain != other.plain) {
        return false;
    }
    // Times count up to the first word that is not plain.
    for (std::size_t k = 0; k < BLOCK_WORDS && (one.plain >> k & 1); ++k) {
        if (one.low[k] != other.low[k]) return false;
    }
    return true;
}

}  // namespace

int main() {
    std::mt19937 random(1);
    for (int turn = 0; turn < 200'000; ++turn) {
        std::vector<std::uint16_t> words(BLOCK_WORDS);
        const unsigned high = random() & 0xFFF, low = random() & 0xFFF;
        unsigned time = low;
        for (auto& word : words) {
            word = static_cast<std::uint16_t>(random());
            if (random() % 8 == 0) word = static_cast<std::uint16_t>(TIME_HIGH << 12 | high);
            // In most blocks times ascend, as a camera's do.
            if (word >> 12 == TIME_LOW && turn % 4 != 0) {
                time = time + random() % 64 < 0xFFF ? time + random() % 64 : 0xFFF;
                word = static_cast<std::uint16_t>(TIME_LOW << 12 | time);
            }
            const bool rare = word >> 12 == UNUSED || word >> 12 > TIME_LOW;
            if (rare && turn % 2 != 0) word = static_cast<std::uint16_t>(EVENT << 12 | (word & 0xFFF));
        }
        Block at_once, one_by_one;
        classify(words.data(), high, low, at_once);
        classify_one_by_one(words.data(), high, low, one_by_one);
        if (!equal(at_once, one_by_one)) {
            std::printf("block %d is seen otherwise at once than word by word\n", turn);
            return 1;
        }
    }
    std::puts("200000 blocks are seen at once as word by word");
}
