// Runs macropixels.v under Verilator on the stimulus that benches/compare/cycle.rs wrote, and times its logic:
// photons are in memory before the clock starts.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "Vmacropixels.h"
#include "Vmacropixels___024root.h"
#include "Vmacropixels_macropixels.h"

struct Pulse { uint32_t edge; uint16_t pixel, spad; };

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

int main(int argc, char **argv) {
    const unsigned periods = atoi(argv[1]), cycles = atoi(argv[2]);
    auto starts = read<uint16_t>("starts.bin");
    auto pulses = read<Pulse>("pulses.bin"); // by edge
    Vmacropixels top;
    top.clk = 0;
    top.kind = 2;
    top.threshold = 0;
    top.eval();
    auto *state = top.rootp->macropixels;
    for (size_t i = 0; i < starts.size(); i++) state->start[i] = starts[i];

    auto begin = std::chrono::steady_clock::now();
    size_t next = 0;
    for (unsigned edge = 0; edge <= periods * cycles; edge++) {
        for (; next < pulses.size() && pulses[next].edge == edge; next++)
            state->raw[pulses[next].pixel] ^= 1u << pulses[next].spad;
        top.stop = edge % periods == 0;
        top.clk = 1;
        top.eval();
        top.clk = 0;
        top.eval();
    }
    std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    printf("%.6f\n", seconds.count());
    FILE *out = fopen("verilator.bin", "wb");
    for (size_t i = 0; i < starts.size() * 16; i++) {
        uint16_t n = state->count[i];
        fwrite(&n, 2, 1, out);
    }
    fclose(out);
}
