// Binds the kernels of jeat_graph.association.
#include "arrays.hpp"
#include "association/assignment.hpp"
#include "association/cover_samples.hpp"

namespace jeat::association {

namespace {

std::vector<Link> links_of(const In<std::int64_t>& tail, const In<std::int64_t>& head, const In<double>& gain,
                           std::size_t nodes) {
    check_lengths({tail.size(), head.size(), gain.size()});
    std::vector<Link> links;
    for (std::size_t k = 0; k < gain.size(); ++k) {
        const auto from = static_cast<std::size_t>(tail.data()[k]), to = static_cast<std::size_t>(head.data()[k]);
        if (from >= nodes || to >= nodes) throw nb::index_error("no such node");
        check(std::isfinite(gain.data()[k]), "a gain is no number");
        links.push_back({from, to, gain.data()[k]});
    }
    return links;
}

Out<std::int64_t> best_links(In<std::int64_t> tail, In<std::int64_t> head, In<double> gain, std::size_t nodes) {
    const std::vector<Link> links = links_of(tail, head, gain, nodes);
    Buffer<std::int64_t> out(nodes);
    {
        const nb::gil_scoped_release release;
        std::fill_n(out.data.get(), nodes, std::int64_t{-1});
        std::vector<Pair> pairs;
        std::vector<std::size_t> numbers;
        for (std::size_t k = 0; k < links.size(); ++k) {
            if (!(links[k].gain > 0.0)) continue;
            pairs.push_back({links[k].tail, links[k].head, links[k].gain});
            numbers.push_back(k);
        }
        Assignment assignment;
        constexpr double kAnySize = std::numeric_limits<double>::infinity();  // the best cover, however large the group
        for (const std::size_t made : assignment.solve(pairs, nodes, nodes, kAnySize))
            out[pairs[made].row] = static_cast<std::int64_t>(numbers[made]);
    }
    return handed_over(std::move(out));
}

Out2<std::int64_t> sample_links(In<std::int64_t> tail, In<std::int64_t> head, In<double> gain, In<std::int64_t> start,
                                std::size_t samples, std::size_t sweeps, std::uint64_t seed) {
    const std::size_t nodes = start.size();
    const std::vector<Link> links = links_of(tail, head, gain, nodes);
    std::vector<std::size_t> next(nodes, links.size());
    std::vector<char> entered(nodes, 0);
    for (std::size_t i = 0; i < nodes; ++i) {
        const std::int64_t k = start.data()[i];
        if (k < 0) continue;
        next[i] = static_cast<std::size_t>(k);
        check(next[i] < links.size() && links[next[i]].tail == i, "a node begins with a link of another");
        check(!entered[links[next[i]].head], "two links begin into one node");
        entered[links[next[i]].head] = 1;
    }
    Buffer<std::int64_t> out(samples * nodes);
    {
        const nb::gil_scoped_release release;
        CoverSampler sampler(links, nodes, std::move(next), seed);
        for (std::size_t s = 0; s < samples; ++s) {
            if (!links.empty()) sampler.sweep(sweeps);
            for (std::size_t i = 0; i < nodes; ++i) {
                const std::size_t k = sampler.links_of_nodes()[i];
                out[s * nodes + i] = k < links.size() ? static_cast<std::int64_t>(k) : -1;
            }
        }
    }
    return handed_over(std::move(out), samples, nodes);
}

}  // namespace

void bind(nb::module_& module) {
    module.def("best_links", &best_links, nb::arg("tail").noconvert(), nb::arg("head").noconvert(),
               nb::arg("gain").noconvert(), nb::arg("nodes"),
               "Of links (E,) from tail to head the set of greatest sum, at most one from and one to each node: the\n"
               "number of each node's (N,), -1 for none.");
    module.def(
        "sample_links", &sample_links, nb::arg("tail").noconvert(), nb::arg("head").noconvert(),
        nb::arg("gain").noconvert(), nb::arg("start").noconvert(), nb::arg("samples"), nb::arg("sweeps"),
        nb::arg("seed"),
        "Such sets drawn with probabilities that go as exp(sum of gains): numbers of the nodes' links\n"
        "(samples, N), -1 for none. start (N,): the set before the first, with `sweeps` draws of each link between.");
}

}  // namespace jeat::association
