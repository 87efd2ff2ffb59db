// The macropixels of the array as cycle-accurate RTL, written for Verilator's speed: no hierarchy, one loop over
// memories, one evaluation per CLK period, nothing done for what is idle. STOP rises with a falling CLK edge and
// the strobe precedes the next rising one, as at 384 MHz.
module macropixels #(parameter PIXELS = 4096) (
    input clk,            // once per CLK period: its falling edge, then its rising one
    input stop,           // a STOP edge comes with this falling edge
    input [1:0] kind,     // TYPE
    input [4:0] threshold
);
    reg [8:0]  start   [0:PIXELS-1] /* verilator public */;
    reg [15:0] raw     [0:PIXELS-1] /* verilator public */; // SPADs that pulsed before this rising edge
    reg [13:0] count   [0:PIXELS*16-1] /* verilator public */;
    reg [8:0]  value   [0:PIXELS-1];
    reg        stopped [0:PIXELS-1];
    reg [15:0] timed   [0:PIXELS-1];
    reg [15:0] shift   [0:PIXELS-1];

    integer i, b;
    reg     event_;
    reg [4:0] n;
    initial for (i = 0; i < PIXELS; i = i + 1) begin
        raw[i] = 0; timed[i] = 0; shift[i] = 0; value[i] = 0; stopped[i] = 1;
        for (b = 0; b < 16; b = b + 1) count[i * 16 + b] = 0;
    end

    wire empty_event = kind == 0 ? threshold != 0 : kind == 1 ? threshold == 0 : 1'b0;

    always @(posedge clk) begin
        for (i = 0; i < PIXELS; i = i + 1) begin
            if (stop) begin
                value[i] = start[i];
                stopped[i] = 0;
            end else if (!stopped[i]) begin
                if (value[i] == 0) begin
                    stopped[i] = 1;
                    if (shift[i] != 0)
                        for (b = 0; b < 16; b = b + 1)
                            if (shift[i][15 - b] && count[i * 16 + b] != 14'h3fff)
                                count[i * 16 + b] = count[i * 16 + b] + 1;
                end
                value[i] = value[i] - 1;
            end
            event_ = empty_event;
            if (timed[i] != 0) begin
                n = $countones(timed[i]);
                event_ = kind == 0 ? n < threshold : kind == 1 ? n == threshold : n > threshold;
            end
            shift[i] = {shift[i][14:0], event_};
            timed[i] = raw[i];
            raw[i] = 0;
        end
    end
endmodule
