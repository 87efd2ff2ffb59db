// A dToF array of another kind: no P-counter and no window. Each pixel notes the first photon of a laser cycle
// in one of 32 bins of a CLK period.
//
//   SPAD ──> caught ──> synchroniser ──┐ first one
//            (cleared by STOP)         ├──> histogram[pixel][bin]   count + 1
//   STOP ──> coarse counter of all ────┘
//
// Bin 0 ends with the first rising edge of CLK after STOP, bin k with the k-th one after that. A photon is counted one
// period later, when the synchroniser shows it. While STOP is high no photon is caught.
`timescale 1ns / 1fs
module coarse_tdc #(
    parameter PIXELS = 256,
    parameter BINS = 32,
    parameter BITS = 14
) (
    input wire clk,
    input wire rst,                             // clears all histograms
    input wire stop,                            // high for less than a CLK period, while the laser fires
    input wire [PIXELS-1:0] spad,
    // Readout: bin `read_bin` of pixel `read_pixel`, one CLK period later with `read_valid`.
    input wire read,
    input wire [$clog2(PIXELS)-1:0] read_pixel,
    input wire [$clog2(BINS)-1:0] read_bin,
    output reg read_valid,
    output reg [BITS-1:0] read_count
);
    localparam TIMES = $clog2(BINS + 2);
    localparam PIXEL_BITS = $clog2(PIXELS);

    // High from STOP to the next edge of CLK.
    reg begins;
    always @(posedge clk or posedge stop)
        if (stop) begins <= 1;
        else begins <= 0;

    // Rising edges of CLK since STOP, up to one after the last bin.
    reg [TIMES-1:0] coarse;
    always @(posedge clk or posedge rst) begin
        if (rst) begin
            coarse <= BINS + 1;
        end else begin
            if (begins) coarse <= 1;
            else if (coarse != BINS + 1) coarse <= coarse + 1'b1;
        end
    end

    wire counts = coarse != 0 && coarse != BINS + 1;
    wire [$clog2(BINS)-1:0] bin = coarse[$clog2(BINS)-1:0] - 1'b1;

    // Whether a photon has come since STOP. These are the only flip-flops with a clock of their own for each pixel.
    wire [PIXELS-1:0] caught;
    genvar g;
    generate
        for (g = 0; g < PIXELS; g = g + 1) begin : pixel
            reg high;
            always @(posedge spad[g] or posedge stop)
                if (stop) high <= 0;
                else high <= 1;
            assign caught[g] = high;
        end
    endgenerate

    // Brought to CLK. A photon is counted at the first edge that shows it.
    reg [PIXELS-1:0] sync, late;
    wire [PIXELS-1:0] first = sync & ~late;
    always @(posedge clk or posedge rst)
        if (rst) begin
            sync <= {PIXELS{1'b1}};
            late <= {PIXELS{1'b1}};
        end else begin
            sync <= caught;
            late <= begins ? {PIXELS{1'b0}} : sync;
        end

    // The histograms of all pixels, one after the other.
    reg [BITS-1:0] histogram [0:PIXELS*BINS-1];
    integer p;
    always @(posedge clk or posedge rst)
        if (rst)
            for (p = 0; p < PIXELS * BINS; p = p + 1) histogram[p] <= 0;
        else if (counts)
            for (p = 0; p < PIXELS; p = p + 1)
                if (first[p])
                    histogram[{p[PIXEL_BITS-1:0], bin}] <= histogram[{p[PIXEL_BITS-1:0], bin}] + 1'b1;

    always @(posedge clk or posedge rst) begin
        if (rst) begin
            read_valid <= 0;
            read_count <= 0;
        end else begin
            read_valid <= read;
            read_count <= histogram[{read_pixel, read_bin}];
        end
    end
endmodule
