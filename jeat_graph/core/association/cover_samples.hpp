// Path covers drawn with probabilities that go as exp(sum of the gains of their links); the definition is
// association/path_cover.py.
//
// A Metropolis chain over matchings: a link is drawn evenly, and taken in or left out, in place of those that it
// excludes where that can be undone by one draw. So each move and its reverse are drawn equally often.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <unordered_map>
#include <vector>

namespace jeat::association {

struct Link {
    std::size_t tail, head;
    double gain;
};

class CoverSampler {
public:
    // `next` is where it begins: the link of each node, links.size() for none.
    CoverSampler(std::span<const Link> links, std::size_t nodes, std::vector<std::size_t> next, std::uint64_t seed)
        : links_(links), out_(std::move(next)), in_(nodes, links.size()), random_(seed) {
        for (const std::size_t k : out_)
            if (k < links_.size()) in_[links_[k].head] = k;
        for (std::size_t k = 0; k < links_.size(); ++k) numbers_[key(links_[k].tail, links_[k].head)] = k;
    }

    // So many draws of a link for each of them.
    void sweep(std::size_t times) {
        for (std::size_t n = links_.size() * times; n > 0; --n) move();
    }
    const std::vector<std::size_t>& links_of_nodes() const { return out_; }

private:
    std::uint64_t key(std::size_t tail, std::size_t head) const {
        return static_cast<std::uint64_t>(tail) * out_.size() + head;
    }
    double uniform() { return static_cast<double>(random_() >> 11) * 0x1.0p-53; }
    bool accepts(double gain) { return gain >= 0.0 || uniform() < std::exp(gain); }

    void move() {
        const std::size_t none = links_.size(), k = random_() % none;
        const Link& link = links_[k];
        const std::size_t from = out_[link.tail], into = in_[link.head];
        if (from == k) {
            if (accepts(-link.gain)) out_[link.tail] = in_[link.head] = none;
            return;
        }
        double gain = link.gain;
        if (from < none) gain -= links_[from].gain;
        if (into < none) gain -= links_[into].gain;
        std::size_t other = none;  // between the two nodes that lose theirs
        if (from < none && into < none) {
            const auto found = numbers_.find(key(links_[into].tail, links_[from].head));
            if (found == numbers_.end()) return;
            other = found->second;
            gain += links_[other].gain;
        }
        if (!accepts(gain)) return;
        if (from < none) in_[links_[from].head] = none;
        if (into < none) out_[links_[into].tail] = none;
        out_[link.tail] = in_[link.head] = k;
        if (other < none) out_[links_[other].tail] = in_[links_[other].head] = other;
    }

    std::span<const Link> links_;
    std::vector<std::size_t> out_, in_;
    std::mt19937_64 random_;
    std::unordered_map<std::uint64_t, std::size_t> numbers_;
};

}  // namespace jeat::association
