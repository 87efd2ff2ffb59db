// Runs macropixels_loop.v, or with WIDTH macropixels_sliced.v, under Verilator on the stimulus that
// benches/compare/cycle.rs wrote, on one thread. Pulses are in memory, macropixel by macropixel, before a clock starts;
// "packing" sorts macropixels by start value and pulses by CLK edge, "logic" is all that the RTL does, its stimulus
// included. Prints the processor seconds of both for each of several runs.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <numeric>
#include <vector>

#include "Vmacropixels.h"
#include "Vmacropixels___024root.h"
#include "Vmacropixels_macropixels.h"

struct Pulse { uint16_t lane, spad; };

#ifdef WIDTH
// Bit `lane` of the word that holds it, of `bits` words for each WIDTH lanes.
template <typename Words> static void set(Words &words, size_t bits, size_t bit, size_t lane) {
    auto &word = words[lane / WIDTH * bits + bit];
#if WIDTH == 64
    word |= uint64_t(1) << (lane % 64);
#else
    word[lane % WIDTH / 32] |= uint32_t(1) << (lane % 32);
#endif
}
template <typename Words> static uint16_t get(Words &words, size_t bits, size_t bit, size_t lane) {
    auto &word = words[lane / WIDTH * bits + bit];
#if WIDTH == 64
    return word >> (lane % 64) & 1;
#else
    return word[lane % WIDTH / 32] >> (lane % 32) & 1;
#endif
}
#endif

template <typename T> static std::vector<T> read(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) { perror(path); exit(2); }
    fseek(file, 0, SEEK_END);
    std::vector<T> items(ftell(file) / sizeof(T));
    rewind(file);
    if (fread(items.data(), sizeof(T), items.size(), file) != items.size()) exit(2);
    fclose(file);
    return items;
}

static double processor_s() {
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

int main(int argc, char **argv) {
    const unsigned periods = atoi(argv[1]), cycles = atoi(argv[2]), runs = atoi(argv[3]);
    const unsigned edges = periods * cycles;
    const auto starts = read<uint16_t>("starts.bin");
    const auto taken = read<uint32_t>("pulses.bin");  // edge << 4 | SPAD, by macropixel and edge
    const auto lengths = read<uint32_t>("lengths.bin"); // pulses of each macropixel
    const size_t pixels = starts.size();
    std::vector<uint16_t> counts(pixels * 16);

    for (unsigned run = 0; run < runs; run++) {
        double begin = processor_s();
        std::vector<uint16_t> order(pixels), lane_of(pixels);
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&](uint16_t a, uint16_t b) { return starts[a] < starts[b]; });
        for (size_t lane = 0; lane < pixels; lane++) lane_of[order[lane]] = lane;
        std::vector<uint32_t> first(edges + 2);
        for (uint32_t pulse : taken) first[(pulse >> 4) + 1]++;
        for (unsigned edge = 0; edge < edges; edge++) first[edge + 1] += first[edge];
        std::vector<Pulse> pulses(taken.size());
        std::vector<uint32_t> next(first);
        const uint32_t *pulse = taken.data();
        for (size_t i = 0; i < pixels; i++)
            for (uint32_t k = 0; k < lengths[i]; k++, pulse++)
                pulses[next[*pulse >> 4]++] = {lane_of[i], uint16_t(*pulse & 15)};
        const double packing = processor_s() - begin;

        auto top = std::make_unique<Vmacropixels>();
        top->clk = 0;
        top->kind = 2;
        top->threshold = 0;
        top->eval();
        auto *state = top->rootp->macropixels;
        for (size_t lane = 0; lane < pixels; lane++) {
            const uint16_t start = starts[order[lane]];
#ifdef WIDTH
            for (int b = 0; b < 9; b++)
                if (start >> b & 1) set(state->start, 9, b, lane);
#else
            state->start[lane] = start;
#endif
        }
        begin = processor_s();
        for (unsigned edge = 0; edge <= edges; edge++) {
            if (edge < edges)
                for (uint32_t k = first[edge]; k < first[edge + 1]; k++) {
                    const Pulse p = pulses[k];
#ifdef WIDTH
                    set(state->raw, 16, p.spad, p.lane);
#else
                    state->raw[p.lane] |= 1u << p.spad;
#endif
                }
            top->stop = edge % periods == 0;
            top->clk = 1;
            top->eval();
            top->clk = 0;
            top->eval();
        }
        printf("%.9f %.9f\n", processor_s() - begin, packing);
        for (size_t i = 0; i < pixels * 16; i++) {
            const size_t lane = lane_of[i / 16], bin = i % 16;
#ifdef WIDTH
            uint16_t n = 0;
            for (int b = 0; b < 14; b++) n |= get(state->count, 16 * 14, bin * 14 + b, lane) << b;
            counts[i] = n;
#else
            counts[i] = state->count[lane * 16 + bin];
#endif
        }
    }
    FILE *out = fopen("theirs.bin", "wb");
    fwrite(counts.data(), 2, counts.size(), out);
    fclose(out);
}
